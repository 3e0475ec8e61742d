//! Panels of a diagram: which quantities of a model it shows.

use crate::map::bifurcation::{Column, SectionPoint};
use crate::map::scene::{DiagramStyle, FigureStyle, Quantity, SECTION};
use crate::model_file::several_gaps;
use crate::show::drawing::frame::PANEL_HEIGHT;
use crate::show::numbers::Number;
use crate::show::symbols::{symbol, with_unit};
use crate::show::wall_labels::WallLabels;
use rattlemap_dynamics::model::{MOST_COORDINATES, Model, Oscillator, Side, State};
use rattlemap_dynamics::orbit::EventKind;

/// Height of the panels of a page, in points, and largest number of panels in a figure of default size.
const PAGE: f64 = 210.0 * 72.0 / 25.4;
const DEFAULT_MOST: usize = 6;

/// Panels and wall labels of a diagram.
#[derive(Clone, Debug)]
pub struct Panels {
    pub(crate) list: Vec<Panel>,
    pub(crate) walls: WallLabels,
}

/// A panel: one component of certain states, or a measured quantity.
#[derive(Clone, Debug)]
pub(crate) struct Panel {
    /// What `[figure] panels` calls it.
    name: &'static str,
    pub(crate) label: String,
    component: usize,
    pub(crate) states: States,
    /// Indices of the gaps whose crossings the panel shows.
    gaps: Vec<usize>,
    /// The quantity that the panel shows instead of states.
    number: Option<Number>,
}

/// States that a panel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum States {
    /// States before every crossing of a wall.
    Crossings,
    /// States before every contact.
    Contacts,
    /// States at phase 0.
    Strobes,
    /// None: the panel shows a measured quantity.
    None,
    /// None: the panel shows the largest Lyapunov exponent.
    Exponents,
}

impl Panels {
    /// Returns the panels of a model: displacements at the walls. With several gaps, a displacement is shown at the walls of those that
    /// depend on it. If the walls [fix](crate::map::bifurcation::fixed) one of the
    /// displacements, the panels show its velocity before contact and the displacements at phase 0 instead. Below them, each of
    /// the `numbers` has a panel, except states and the gap if it is one displacement. The last panel shows exponents.
    pub fn of(model: &dyn Model, fixed: Option<usize>, numbers: &[Number]) -> Panels {
        let walls = WallLabels::of_all(model);
        let names: Vec<String> = model.state_names().into_iter().map(symbol).collect();
        let displacements = || (0..names.len()).step_by(2);
        let units = model.units();
        let of_gaps = Gaps::of(model);
        let panel = |label: String, component, states| Panel {
            name: SECTION,
            label: with_unit(&label, units.component(component).as_deref()),
            component,
            states,
            gaps: of_gaps.on(component / 2),
            number: None,
        };
        let mut list: Vec<Panel> = match fixed.map(|i| 2 * i + 1).filter(|velocity| *velocity < names.len()) {
            None => {
                let label = |i: usize| format!("{} at {}{}", names[i], walls.section(), of_gaps.named(i / 2));
                displacements().map(|i| panel(label(i), i, States::Crossings)).collect()
            }
            Some(velocity) => {
                let label = format!("velocity before contact, {}", names[velocity]);
                let strobe = |i: usize| panel(format!("{} at phase 0", names[i]), i, States::Strobes);
                let first = panel(label, velocity, States::Contacts);
                [first].into_iter().chain(displacements().map(strobe)).collect()
            }
        };
        // Where the gap is one displacement, it would be shown twice.
        let is_shown = |number: &&Number| {
            number.quantity != Quantity::State && (fixed.is_none() || !number.name.ends_with("_gap"))
        };
        let measured = numbers.iter().filter(is_shown);
        let other = |name, label, states, number| Panel {
            name,
            label,
            component: 0,
            states,
            gaps: Vec::new(),
            number,
        };
        list.extend(measured.map(|number| {
            other(number.quantity.name(), number.label.clone(), States::None, Some(number.clone()))
        }));
        list.push(other(Quantity::Lyapunov.name(), String::new(), States::Exponents, None));
        Panels { list, walls }
    }

    /// Divides the panels that a scene wants into figures. All panels of one figure fit on a page.
    pub fn figures(mut self, style: &FigureStyle, diagram: &DiagramStyle) -> Vec<Panels> {
        self.list.retain(|panel| diagram.panels.as_ref().is_none_or(|wanted| wanted.contains(&panel.name)));
        let of_width = |points: f64| (PAGE / (PANEL_HEIGHT * points)) as usize;
        let most = if diagram.is_divided { 1 } else { style.width.map_or(DEFAULT_MOST, of_width).max(2) };
        // Figures of about equal height.
        let figures = self.list.len().div_ceil(most).max(1);
        let parts = self.list.chunks(self.list.len().div_ceil(figures).max(1));
        parts.map(|part| Panels { list: part.to_vec(), walls: self.walls.clone() }).collect()
    }

    /// Whether a panel shows such states.
    pub(crate) fn has(&self, states: &[States]) -> bool {
        self.list.iter().any(|panel| states.contains(&panel.states))
    }
}

/// The gaps of a model.
struct Gaps {
    /// Rows of the gaps; none of a model that is not valid.
    rows: Vec<[f64; MOST_COORDINATES]>,
    /// Names, if there are several.
    names: Option<Vec<String>>,
}

impl Gaps {
    fn of(model: &dyn Model) -> Gaps {
        let oscillator = model.oscillator().ok();
        let rows =
            |oscillator: Oscillator| (0..oscillator.gaps.len()).map(|gap| oscillator.gap_row(gap)).collect();
        Gaps { rows: oscillator.map_or(Vec::new(), rows), names: several_gaps(model) }
    }

    /// Returns the gaps that depend on a displacement: all, if none does or there is only one.
    fn on(&self, displacement: usize) -> Vec<usize> {
        let all = 0..self.rows.len().max(1);
        let depends = |gap: &usize| self.rows[*gap][displacement] != 0.0;
        match self.names.is_some() && all.clone().any(|gap| depends(&gap)) {
            true => all.filter(depends).collect(),
            false => all.collect(),
        }
    }

    /// Completes a label with the names of the gaps that depend on a displacement, if there are several.
    fn named(&self, displacement: usize) -> String {
        let Some(names) = &self.names else { return String::new() };
        let names: Vec<String> = self.on(displacement).into_iter().map(|gap| symbol(&names[gap])).collect();
        format!(" of {}", names.join(" and "))
    }
}

impl Panel {
    /// Returns the values in a column, with the wall of each unless it is a state at phase 0.
    pub(crate) fn values(&self, column: &Column) -> Vec<(f64, Option<Side>)> {
        let component = |state: &State| state[self.component];
        let crossings = |wanted: fn(EventKind) -> bool| -> Vec<(f64, Option<Side>)> {
            let is_shown = |point: &&SectionPoint| wanted(point.kind) && self.gaps.contains(&point.gap);
            let points = column.points.iter().filter(is_shown);
            points.map(|point| (component(&point.before), Some(point.side))).collect()
        };
        match self.states {
            States::Crossings => crossings(|_| true),
            States::Contacts => crossings(|kind| kind != EventKind::MeshEnd),
            States::Strobes => column.strobes.iter().map(|state| (component(state), None)).collect(),
            States::None => {
                let value = self.number.as_ref().and_then(|number| number.of_column(column));
                value.map(|value| (value, None)).into_iter().collect()
            }
            States::Exponents => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model_file::FileModel;
    use rattlemap_dynamics::model::{GearPair, REST, state};
    use rattlemap_dynamics::orbit::Class;

    #[test]
    fn a_displacement_is_shown_at_the_walls_of_its_gaps() {
        let model = FileModel::built_in("two-loose-gears").unwrap();
        let panels = Panels::of(&model, None, &[]);
        let labels: Vec<&str> = panels.list.iter().map(|panel| &*panel.label).collect();
        let expected = [
            "s at the walls of a and b [m]",
            "x\u{2081} at the walls of a [m]",
            "x\u{2082} at the walls of b [m]",
        ];
        assert_eq!(labels[..3], expected);
        let point = |gap| SectionPoint {
            gap,
            side: Side::Right,
            kind: EventKind::Impact,
            t_mod_period: 0.0,
            before: state(&[1.0, 0.0, 2.0, 0.0, 3.0]),
            after: REST,
        };
        let column = Column { points: vec![point(0), point(1)], ..Column::plain(0.0, Class::Chaotic) };
        let values: Vec<Vec<f64>> = panels.list[..3]
            .iter()
            .map(|panel| panel.values(&column).into_iter().map(|(x, _)| x).collect())
            .collect();
        assert_eq!(values, [vec![1.0, 1.0], vec![2.0], vec![3.0]]);
    }

    #[test]
    fn each_measured_number_has_a_panel_below_the_displacements() {
        let model = GearPair::paper(0.5);
        let numbers = Number::of(&model, &[Quantity::State, Quantity::ImpactSpeed, Quantity::Rms]);
        let panels = Panels::of(&model, None, &numbers);
        let labels: Vec<&str> = panels.list[2..6].iter().map(|panel| &*panel.label).collect();
        let rms = ["x\u{2081}", "x\u{2082}", "gap"].map(|name| format!("root mean square of {name}"));
        assert_eq!(labels, [&["mean approach speed of impacts".to_owned()], &rms[..]].concat());
        let mut column = Column::plain(1.0, Class::Chaotic);
        let group = Quantity::Rms.group().unwrap();
        group.measures().for_each(|measure| column.measures[measure.place] = Some(measure.place as f64));
        let values: Vec<_> = panels.list[2..6].iter().map(|panel| panel.values(&column)).collect();
        let first = group.measures().next().unwrap().place as f64;
        let of = |i: u32| vec![(first + f64::from(i), None)];
        assert_eq!(values, [vec![], of(0), of(1), of(2)], "no value without impacts");
    }
}
