//! What may be the reason that a record differs from the reference.

/// Why a cell's record is not what the reference says within the same budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Explanation {
    /// The lane's caps ended the cell, and its status says so; the reference, whose caps are
    /// wider, was seen to need more.
    EngineCap,
    /// The reference does not decide within the budget, but gives the record's answer when it
    /// may take longer; or the record says `undecided`, and the motion settles too late or
    /// grows too little for it to say more, be it that the reference is still in chaos that ends on
    /// a cycle; or neither side decides, and the motion averaged in the lane's way gives the record.
    UndecidedInBudget,
    /// The reference, started on the record's own strobe state, has the record's class,
    /// period, word, exponent and averages: another attractor of the same cell. And the cell's own
    /// start leads there within rounding, which a lane from any other start could not say.
    CoexistingAttractor,
    /// Chaos: a transient of one side outlives the budget, or averages over it scatter as
    /// much on the reference itself when its start moves within rounding.
    Chaos,
    /// The reference gives the record's answer when the start or a parameter moves within the
    /// rounding of the precision; or the largest multiplier is within 1 % of one per period, a
    /// bifurcation, and the motion does recur after the record's period; or the multiplier is
    /// below -0.8, and rounding, which the cycle amplifies, keeps the lane alternating about it
    /// with twice its period; or a parameter moves by as little as rounding makes the lane's
    /// strobes scatter.
    Border,
    /// The lane read its cycle before the motion had settled on it, or rounding keeps it from
    /// settling: the reference, read at the same place, on the record's strobe state, or as far
    /// from it as a cycle takes it, gives the same.
    Unsettled,
    /// The reference's cycle is within what lanes resolve (2.5e-4 of the motion) of one with the
    /// record's period, a divisor of its own; or rounding keeps the lane that much off the cycle,
    /// in a pattern whose period is a multiple; or the steps of a cycle round by more than lanes
    /// tell a symmetric one from an unsymmetric one by; or rounding of the tangents alone moves
    /// the exponent that far, from one that repels to one that attracts if need be; or rounding, which
    /// the cycle amplifies, keeps a lane from ever seeing it settle, however long it runs; or an event lies on a
    /// strobe to rounding, and the state is that on its other side.
    BelowResolution,
    /// Lanes call a cycle symmetric that is its own mirror image to 2.5e-4 of its size; this one
    /// is, but not quite.
    NearlySymmetric,
    /// An event is nearer to grazing than the precision resolves, where small errors become
    /// their square roots, and the motion does recur after the record's period.
    NearGrazing,
}

impl Explanation {
    /// Every explanation, in the order in which they are told.
    pub const ALL: [Explanation; 9] = [
        Explanation::CoexistingAttractor,
        Explanation::Chaos,
        Explanation::Border,
        Explanation::NearGrazing,
        Explanation::UndecidedInBudget,
        Explanation::BelowResolution,
        Explanation::Unsettled,
        Explanation::NearlySymmetric,
        Explanation::EngineCap,
    ];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Explanation::EngineCap => "engine_cap",
            Explanation::UndecidedInBudget => "undecided_in_budget",
            Explanation::CoexistingAttractor => "coexisting_attractor",
            Explanation::Chaos => "chaos",
            Explanation::Border => "border",
            Explanation::Unsettled => "unsettled",
            Explanation::BelowResolution => "below_resolution",
            Explanation::NearGrazing => "near_grazing",
            Explanation::NearlySymmetric => "nearly_symmetric",
        }
    }
}
