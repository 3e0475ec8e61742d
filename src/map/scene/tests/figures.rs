//! `[figure]`: style and lines of figures.

use super::*;

const BASE: &str = "[[axis]]\nparameter = \"k1\"\nmin = 1.0\nmax = 9.0\ncount = 4\n\
                    [[axis]]\nparameter = \"omega\"\nmin = 1.0\nmax = 12.0\ncount = 3\n\
                    [parameters]\ne = 0.5\n[derived]\nk2 = \"2*k1\"\n[figure]\n";

fn read(figure: &str) -> Result<Scene, SceneError> {
    Scene::parse(&format!("{BASE}{figure}"), "s.toml", &[], Purpose::Map)
}

#[test]
fn widths_have_a_unit_and_become_points() {
    for (width, points) in [("85mm", 240.945), ("8.5 cm", 240.945), ("3.5in", 252.0), ("250pt", 250.0)] {
        let scene =
            read(&format!("width = \"{width}\"\nfont_size = 8\ntitle = \"\"\nlegend = false\n")).unwrap();
        let style = scene.figure_style();
        assert!((style.width.unwrap() - points).abs() < 1e-3, "{style:?}");
        assert_eq!((style.font_size, style.title.as_deref(), style.legend), (Some(8.0), Some(""), false));
    }
    assert_eq!(*read("").unwrap().figure_style(), FigureStyle::default());
}

#[test]
fn wrong_styles_are_refused_with_their_place_and_the_remedy() {
    for (figure, place, part) in [
        ("width = 85", "s.toml:16:9: `figure.width", "text in quotes"),
        ("width = \"85\"", "s.toml:16:9: `figure.width", "such as \"85mm\""),
        ("width = \"5mm\"", "s.toml:16:9: `figure.width", "from 60 mm to 300 mm"),
        ("font_size = 6", "s.toml:16:13: `figure.font_size", "from 7 to 24 points"),
        (
            "width = \"60mm\"\nfont_size = 9",
            "s.toml:17:13: `figure.font_size",
            "at most 8 points at this width",
        ),
        ("colour = 1", "s.toml:16:1: ", "legend, panels, files, scale, contours, gap, lines"),
        ("panels = [\"amplitude\"]", "s.toml:16:11: `figure.panels.0", "section, lyapunov"),
        ("scale = { rms = \"log\" }", "s.toml:16:11: ", "lyapunov, impacts, mesh"),
        ("scale = { mesh = [2, 1] }", "s.toml:16:18: `figure.scale.mesh", "ascending ends"),
        ("scale = { mesh = [\"log\", 0, 1] }", "s.toml:16:18: `figure.scale.mesh", "above 0"),
        (
            "contours = { mesh = [0.5] }",
            "s.toml:16:14: unknown field `figure.contours.mesh",
            "lyapunov; request more in `outputs.quantities`",
        ),
        ("contours = { lyapunov = 1 }", "s.toml:16:25: `figure.contours.lyapunov", "such as [1e-3, 1e-2]"),
        ("contours = { lyapunov = [] }", "s.toml:16:25: `figure.contours.lyapunov", "1 to 32 numbers"),
        (
            "scale = { lyapunov = \"log\" }\ncontours = { lyapunov = [0.1, -1] }",
            "s.toml:17:31: `figure.contours.lyapunov.1",
            "above 0 on a scale that is not linear",
        ),
        ("lines = 3", "s.toml:16:9: `figure.lines", "names and expressions"),
        ("lines = { a = \"k1 - q\" }", "s.toml:16:15: `figure.lines.a", "`q`"),
        ("lines = { a = \"k1 -\" }", "s.toml:16:15: `figure.lines.a", "cannot be read"),
        ("lines = { a = \"e - 1\" }", "s.toml:16:15: `figure.lines.a", "the same value in all cells"),
    ] {
        let message = read(figure).unwrap_err().to_string();
        assert!(message.starts_with(place) && message.contains(part), "{figure}: {message}");
    }
    let lines: Vec<String> = (0..33).map(|n| format!("l{n} = \"omega - {n}\"")).collect();
    let message = read(&format!("lines = {{ {} }}", lines.join(", "))).unwrap_err().to_string();
    assert!(
        message.contains("`figure.lines = 33 lines` is out of range: it must be at most 32 lines"),
        "{message}"
    );
    read(&format!("lines = {{ {} }}", lines[1..].join(", "))).unwrap();
}

#[test]
fn layers_have_scales_with_ends() {
    let scene = read("scale = { mesh = \"log\", lyapunov = [\"dB\", 1e-3, 1] }").unwrap();
    assert_eq!(scene.layer_scale("mesh"), (Some(1.0), None));
    assert_eq!(scene.layer_scale("lyapunov"), (Some(20.0), Some([1e-3, 1.0])));
    assert_eq!(scene.layer_scale("impacts"), (None, None));
}

#[test]
fn lines_are_functions_of_axes_and_derived_parameters_and_do_not_change_the_identity() {
    let scene = read("[figure.lines]\nsecond = \"k2 - omega\"\nfirst = \"k1*omega - e\"\n").unwrap();
    let names: Vec<&str> = scene.lines().iter().map(|line| line.name.as_str()).collect();
    assert_eq!(names, ["second", "first"]);
    let values: Vec<f64> =
        scene.lines().iter().map(|line| line.function(scene.points())([3.0, 4.0])).collect();
    assert_eq!(values, [2.0, 11.5]);
    assert_eq!(scene.identity(), read("").unwrap().identity());
}
