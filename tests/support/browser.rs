//! A headless browser, driven through the pipe of the DevTools protocol: messages in JSON, each ended by a zero byte.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::{Value, json};

use super::support::root;

/// A browser with one page in it. Dropping it ends it.
pub struct Browser {
    process: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    session: Option<String>,
    sent: u64,
    /// What the page wrote to its console, and exceptions that nothing caught.
    pub complaints: Vec<String>,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// Opens `page` in a window of the given size; none where set-up has found no browser.
    pub fn open(page: &Path, width: u32, height: u32) -> Option<Self> {
        let program = root().join(".welkin/chromium/run");
        if !program.exists() {
            println!(
                "no browser: scripts/setup --tests found none for this machine; the report is not clicked through"
            );
            return None;
        }
        let profile = tempfile::tempdir().unwrap();
        // The browser reads from descriptor 3 and writes to 4. Tests run as root in containers, which its sandbox refuses.
        let mut process = Command::new("sh")
            .args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 0</dev/null 1>/dev/null 2>/dev/null"])
            .arg(program)
            .args(["--remote-debugging-pipe", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
            .args(["--force-color-profile=srgb", "--hide-scrollbars", "--no-first-run"])
            .arg(format!("--window-size={width},{height}"))
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (to, from) = (process.stdin.take().unwrap(), BufReader::new(process.stdout.take().unwrap()));
        let (session, complaints) = (None, Vec::new());
        let mut browser = Self { process, to, from, session, sent: 0, complaints, _profile: profile };
        let target = browser.call("Target.createTarget", json!({"url": "about:blank"}));
        let session = browser.call("Target.attachToTarget", json!({"targetId": target["targetId"], "flatten": true}));
        browser.session = session["sessionId"].as_str().map(str::to_owned);
        browser.call("Runtime.enable", json!({}));
        browser.call("Log.enable", json!({}));
        browser.call("Page.enable", json!({}));
        browser.call("Page.navigate", json!({"url": format!("file://{}", page.display())}));
        Some(browser)
    }

    /// Calls a method of the protocol and returns its result.
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        self.sent += 1;
        let mut message = json!({"id": self.sent, "method": method, "params": params});
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        write!(self.to, "{message}\0").unwrap();
        loop {
            let mut bytes = Vec::new();
            self.from.read_until(0, &mut bytes).unwrap();
            assert_eq!(bytes.pop(), Some(0), "the browser has gone away during {method}");
            let mut answer: Value = serde_json::from_slice(&bytes).unwrap();
            if answer["id"] == json!(self.sent) {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].take();
            }
            let told = ["Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded"];
            if answer["method"].as_str().is_some_and(|method| told.contains(&method)) {
                self.complaints.push(answer["params"].to_string());
            }
        }
    }

    /// The value of a JavaScript expression, awaited if it is a promise.
    pub fn value(&mut self, expression: &str) -> Value {
        let params = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let mut answer = self.call("Runtime.evaluate", params);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].take()
    }

    /// Waits until `expression` is true; at most half a minute, which a busy machine may need.
    pub fn until(&mut self, expression: &str) {
        let script = format!(
            "new Promise((resolve, reject) => {{ const end = Date.now() + 30000; (function look() {{ \
             if ({expression}) resolve(true); else if (Date.now() > end) resolve(false); else setTimeout(look, 20); }})(); }})"
        );
        assert_eq!(self.value(&script), json!(true), "{expression} never came true");
    }

    /// Centre of an element in the window [CSS pixels].
    pub fn centre(&mut self, selector: &str) -> [f64; 2] {
        let script = format!(
            "(() => {{ const e = document.querySelector({selector:?}); e.scrollIntoView({{block: 'nearest'}}); \
             const r = e.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; }})()"
        );
        let at = self.value(&script);
        [at[0].as_f64().unwrap(), at[1].as_f64().unwrap()]
    }

    /// A mouse event: `mousePressed`, `mouseMoved` or `mouseReleased`.
    pub fn mouse(&mut self, kind: &str, at: [f64; 2]) {
        let held = u32::from(kind != "mouseReleased");
        let params = json!({"type": kind, "x": at[0], "y": at[1], "button": "left", "buttons": held, "clickCount": 1});
        self.call("Input.dispatchMouseEvent", params);
    }

    /// Presses the mouse at `from`, moves it to `to` and lets go.
    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        self.mouse("mousePressed", from);
        self.mouse("mouseMoved", [(from[0] + to[0]) / 2.0, (from[1] + to[1]) / 2.0]);
        self.mouse("mouseMoved", to);
        self.mouse("mouseReleased", to);
    }

    /// Moves the mouse there, with no button down.
    pub fn hover(&mut self, at: [f64; 2]) {
        self.call("Input.dispatchMouseEvent", json!({"type": "mouseMoved", "x": at[0], "y": at[1]}));
    }

    /// Clicks on an element.
    pub fn click(&mut self, selector: &str) {
        let at = self.centre(selector);
        self.drag(at, at);
    }

    /// Presses a key and lets go.
    pub fn key(&mut self, key: &str) {
        let text = if key.chars().count() == 1 { key } else { "" };
        let kind = if text.is_empty() { "rawKeyDown" } else { "keyDown" };
        self.call("Input.dispatchKeyEvent", json!({"type": kind, "key": key, "text": text}));
        self.call("Input.dispatchKeyEvent", json!({"type": "keyUp", "key": key}));
    }

    /// A picture of the window as PNG, in base64.
    pub fn screenshot(&mut self) -> String {
        self.call("Page.captureScreenshot", json!({"format": "png"}))["data"].as_str().unwrap().to_owned()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let message = json!({"id": 0, "method": "Browser.close"});
        let _ = write!(self.to, "{message}\0"); // It may be gone already.
        let _ = self.process.wait();
    }
}
