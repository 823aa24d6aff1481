//! A page in a real browser, by way of `tests/view/remote.mjs`. Needs Node and Chromium.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::{Value, json};

/// A browser with one page.
pub struct Browser {
    node: Child,
    to: Option<ChildStdin>,
    from: BufReader<ChildStdout>,
}

impl Browser {
    /// Starts it; an error says what is missing.
    pub fn start() -> Result<Self, &'static str> {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/view/remote.mjs");
        let mut node = Command::new("node");
        node.arg(script).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut node = node.spawn().map_err(|_| "node cannot be started")?;
        let (to, from) = (node.stdin.take(), BufReader::new(node.stdout.take().unwrap()));
        let mut browser = Self { node, to, from };
        match browser.answer() {
            Value::Bool(true) => Ok(browser),
            _ => Err("chromium cannot be started"),
        }
    }

    /// Opens an address on the page.
    pub fn open(&mut self, url: &str) {
        self.say("open", url);
    }

    /// Waits until an expression is true on the page; its value.
    pub fn until(&mut self, expression: &str) -> Value {
        self.say("until", expression)
    }

    /// Clicks what a selector finds, as soon as it does.
    pub fn click(&mut self, selector: &str) {
        self.until(&format!("(document.querySelector({}).click(), true)", json!(selector)));
    }

    /// Clicks the button with this text, as soon as there is one that shows.
    pub fn click_button(&mut self, text: &str) {
        let find = format!("[...document.querySelectorAll('button')].find(b => b.textContent === {}", json!(text));
        self.until(&format!("({find} && b.checkVisibility()).click(), true)"));
    }

    /// Presses a key.
    pub fn press(&mut self, key: &str) {
        self.say("press", key);
    }

    /// What has gone wrong on the page since this was last asked.
    pub fn errors(&mut self) -> Vec<String> {
        serde_json::from_value(self.ask(&json!({"errors": true}))).unwrap()
    }

    fn say(&mut self, command: &str, argument: &str) -> Value {
        self.ask(&json!({ command: argument }))
    }

    fn ask(&mut self, line: &Value) -> Value {
        writeln!(self.to.as_mut().unwrap(), "{line}").unwrap();
        self.answer()
    }

    fn answer(&mut self) -> Value {
        let mut line = String::new();
        self.from.read_line(&mut line).unwrap();
        let mut answer: Value = serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line:?}"));
        assert!(answer["error"].is_null(), "{answer}");
        answer["value"].take()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // Node ends the browser when nothing more can come.
        drop(self.to.take());
        let _ = self.node.wait();
    }
}
