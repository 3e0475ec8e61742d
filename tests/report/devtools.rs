//! Real input, paper and a phone: the browser is driven over DevTools. Skipped without Chromium, with a message on stderr.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use crate::report::live::explored;
use crate::report::page::{chromium, skipped};

/// A browser that shows a page.
pub(crate) struct Browser {
    process: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
    session: Value,
}

impl Browser {
    /// Opens a page, and waits for its map; none without a browser.
    pub(crate) fn open(page: &Path) -> Option<Browser> {
        let Some(name) = chromium() else {
            skipped();
            return None;
        };
        // The browser reads requests from descriptor 3 and answers on 4.
        let start = "exec \"$0\" --headless --no-sandbox --disable-gpu --remote-debugging-pipe 3<&0 4>&1 </dev/null >/dev/null";
        let mut command = Command::new("sh");
        command.args(["-c", start, name]).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut process = command.spawn().unwrap();
        let (requests, answers) =
            (process.stdin.take().unwrap(), BufReader::new(process.stdout.take().unwrap()));
        let mut browser = Browser { process, requests, answers, session: Value::Null };
        let tab = browser.call("Target.createTarget", json!({ "url": format!("file://{}", page.display()) }));
        let attached = json!({ "targetId": tab["targetId"], "flatten": true });
        browser.session = browser.call("Target.attachToTarget", attached)["sessionId"].clone();
        browser.resize(1300, 850, false);
        browser.until("typeof map !== 'undefined' && !document.getElementById('wait')");
        Some(browser)
    }

    fn call(&mut self, method: &str, params: Value) -> Value {
        let mut request = json!({ "id": 1, "method": method, "params": params });
        if self.session != Value::Null {
            request["sessionId"] = self.session.clone();
        }
        write!(self.requests, "{request}\0").unwrap();
        loop {
            let mut bytes = Vec::new();
            self.answers.read_until(0, &mut bytes).unwrap();
            let mut answer: Value = serde_json::from_slice(&bytes[..bytes.len() - 1]).unwrap();
            // Answers without a number are events.
            if answer["id"] == 1 {
                assert_eq!(answer["error"], Value::Null, "{method}");
                return answer["result"].take();
            }
        }
    }

    /// Returns the value of an expression in the page.
    pub(crate) fn value(&mut self, expression: &str) -> Value {
        let params = json!({ "expression": expression, "returnByValue": true });
        let found = self.call("Runtime.evaluate", params);
        assert_eq!(found["exceptionDetails"], Value::Null, "{expression}");
        found["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub(crate) fn until(&mut self, expression: &str) {
        let begun = Instant::now();
        while self.value(expression) != true {
            assert!(begun.elapsed() < Duration::from_secs(60), "{expression} did not become true");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn resize(&mut self, width: u32, height: u32, is_phone: bool) {
        let params = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": is_phone });
        self.call("Emulation.setDeviceMetricsOverride", params);
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.process.kill().and_then(|()| self.process.wait());
    }
}

/// Whether the page has computed the visible part.
const IS_WHOLE: &str = "uppermost().columns >= 65 && (!live || live.isWhole && covers(live.made, view))";

#[test]
fn a_page_works_with_wheel_and_tab_keys_on_paper_and_on_a_phone() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut page) = Browser::open(&explored(&folder, &["e_omega.toml"])) else { return };
    let at = page.value("(({ left, top }) => [left + 300, top + 200])(canvas.getBoundingClientRect())");
    let place = "position(300, 200).map((x) => x.toFixed(6))";
    let before = page.value(place);
    let wheel = json!({ "type": "mouseWheel", "x": at[0], "y": at[1], "deltaX": 0, "deltaY": -400 });
    page.call("Input.dispatchMouseEvent", wheel);
    page.until("view.width < 0.6 * columns");
    assert_eq!(page.value(place), before, "the place under the pointer moved");
    assert_eq!(page.value("scrollY"), 0);
    // New records change the shares in the legend.
    page.until("live?.isWhole && live.columns >= 65 && covers(live.made, view)");
    // Every control once, in the order of the document and with a mark of the focus.
    let controls = "[...document.querySelectorAll('[tabindex=\"0\"], input, summary, button:not([tabindex=\"-1\"]):enabled')].filter((each) => \
                    each.checkVisibility()).map(({ id, textContent: text }) => id || text)";
    let focused = "(({ id, textContent: text }) => document.querySelector(':focus-visible') && (id || text))(document.activeElement)";
    let controls = page.value(controls);
    for control in controls.as_array().unwrap() {
        for kind in ["rawKeyDown", "keyUp"] {
            let tab = json!({ "type": kind, "key": "Tab", "code": "Tab", "windowsVirtualKeyCode": 9 });
            page.call("Input.dispatchKeyEvent", tab);
        }
        assert_eq!(page.value(focused), *control, "{controls}");
    }
    assert!(
        controls.as_array().is_some_and(|all| all.len() > 50 && all.contains(&"canvas".into())),
        "{controls}"
    );
    // The paper has the drawn cells as an image, one pixel for each, in two pages or fewer.
    page.value("showAll()");
    page.until(IS_WHOLE);
    let [columns, rows] = [page.value("uppermost().columns"), page.value("uppermost().rows")];
    let printed = page.call("Page.printToPDF", json!({ "printBackground": true }))["data"].take();
    let paper = STANDARD.decode(printed.as_str().unwrap()).unwrap();
    let paper = String::from_utf8_lossy(&paper);
    assert!(
        paper.contains(&format!("/Subtype /Image\n/Width {columns}\n/Height {rows}\n")),
        "no image of the map"
    );
    assert!((1..=2).contains(&paper.matches("/Type /Page\n").count()));
    page.resize(390, 844, true);
    page.until("innerWidth === 390");
    assert_eq!(page.value("document.scrollingElement.scrollWidth"), 390);
    let tops = "['stage', 'legend-box', 'readout', 'parameters'].map((id) => document.getElementById(id).getBoundingClientRect().top)";
    let tops: Vec<f64> = serde_json::from_value(page.value(tops)).unwrap();
    assert!(tops.is_sorted(), "{tops:?}");
}
