use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::*;
use rattlemap_dynamics::reference::Trajectory;
use rattlemap_dynamics::stability::{StrobeMap, refine};
use nalgebra::Vector4;
fn main() {
    let a: Vec<f64> = std::env::args().skip(1).map(|x| x.parse().unwrap()).collect();
    let p = a[2] as u32;
    let pair = GearPair { omega: a[1], ..GearPair::paper(a[0]) };
    let flow = Flow::new(&pair.oscillator().unwrap());
    let mut t = Trajectory::new(&flow, pair.law(), [0.0; 4]);
    let mut s = vec![t.clone()];
    for _ in 0..4000 { t.advance_period(&mut ()).unwrap(); s.push(t.clone()); }
    let c = refine(&s[4000 - 4000 % p as usize], StrobeMap::Periods(p)).unwrap();
    println!("radius {} mult {:?}", c.spectral_radius(), c.multipliers);
    let y = Vector4::from(c.state);
    let mut n = 0usize;
    while n < 120 {
        let d0 = Vector4::from(s[n].state()) - y;
        let d1 = Vector4::from(s[n + p as usize].state()) - y;
        println!("{n} {:.3e} {:.3e} {:.3e} {:.3e} | off {:.3e} of {:.3e}", d0[0], d0[1], d0[2], d0[3], (d1 - c.monodromy * d0).amax(), d0.amax());
        n += p as usize * a.get(3).map_or(1, |x| *x as usize);
    }
}
