//! A checked mission written down again: all that it came to, defaults and command line included.

use std::fmt::Write;

use elk_bus::moos::gateway::{CONNECTIONS, GatewayOptions};

use crate::arguments::join_arguments;
use crate::bus::BUS;
use crate::element::{self, ELEMENTS};
use crate::policy::{self, Policy, Restart};
use crate::spec::{AppSpec, Mission, Mode, Program, Via};

impl Mission {
    /// The mission as XML that means the same in any folder and under other defaults. Parameters of which `omit` says so
    /// are left out.
    pub fn to_xml(&self, omit: &dyn Fn(&AppSpec, &str) -> bool) -> String {
        let mode = match self.mode {
            Mode::Auto => "auto",
            Mode::Manual => "manual",
        };
        let Policy { restarts, window_secs, .. } = self.broker;
        let mut text = format!(
            "<Scenario name=\"{}\" type=\"{mode}\" version=\"1\" broker-restarts=\"{restarts}\" \
             broker-window=\"{window_secs}\" mailbox=\"{}\" time-warp=\"{}\"{}>\n",
            escaped(&self.name),
            self.mailbox_mb,
            self.time_warp,
            self.launched()
        );
        if let Some(moos) = &self.moos {
            put_bus(&mut text, moos);
        }
        for app in &self.apps {
            put_app(&mut text, app, omit);
        }
        for element::Element { name, .. } in ELEMENTS.iter().filter(|element| element.supposed) {
            if self.of_element(name).next().is_none() {
                text += &format!("    <{name} type=\"none\"/>\n");
            }
        }
        text + "</Scenario>\n"
    }
}

impl Mission {
    /// Where it is launched, and how fast, if that is not as usual.
    fn launched(&self) -> String {
        let community = self.community.as_ref().map(|name| format!(" community=\"{name}\"")).unwrap_or_default();
        let pause = self.launch_pause_secs;
        let pause = if pause > 0.0 { format!(" {}=\"{pause}\"", policy::LAUNCH_PAUSE) } else { String::new() };
        community + &pause
    }
}

fn put_bus(text: &mut String, moos: &GatewayOptions) {
    let from = moos.networks.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
    let from = if from.is_empty() { from } else { format!(" from=\"{from}\"") };
    let sources = if moos.any_source { "any" } else { "own" };
    let texts = moos.texts.patterns().collect::<Vec<_>>().join(" ");
    let texts = if texts.is_empty() { texts } else { format!(" texts=\"{}\"", escaped(&texts)) };
    let most = moos.connections;
    let most = if most == CONNECTIONS { String::new() } else { format!(" connections=\"{most}\"") };
    let address = escaped(&moos.address.to_string());
    // Writing to a String cannot fail.
    let _ = writeln!(text, "    <{BUS} moos=\"{address}\"{from} sources=\"{sources}\"{texts}{most}/>");
}

fn put_app(text: &mut String, app: &AppSpec, omit: &dyn Fn(&AppSpec, &str) -> bool) {
    let element = &app.element;
    // Writing to a String cannot fail.
    let _ = write!(text, "    <{element} name=\"{}\"{}{}>", escaped(&app.name), program(&app.program), policy(app));
    let said = app.settings.iter().filter(|(name, _)| !omit(app, name));
    let said: String = said.map(|(name, value)| format!("\n        <{name}>{}</{name}>", escaped(value))).collect();
    let _ = match said.as_str() {
        "" => writeln!(text, "</{element}>"),
        said => writeln!(text, "{said}\n    </{element}>"),
    };
}

fn program(program: &Program) -> String {
    match program {
        Program::Builtin(app_type, _) => format!(" type=\"{}\"", app_type.name),
        Program::Foreign { exec, args, via } => {
            let path = exec.to_string_lossy();
            // A bare name is looked for in `PATH`.
            let exec = if path.contains('/') { std::path::absolute(exec).ok() } else { None };
            let exec = exec.map_or(path.clone(), |exec| exec.to_string_lossy().into_owned().into());
            if *via == Via::Lines {
                let line = join_arguments(&[&[exec.into_owned()], &args[..]].concat());
                return format!(" pipe=\"{}\"", escaped(&line));
            }
            let args =
                if args.is_empty() { String::new() } else { format!(" args=\"{}\"", escaped(&join_arguments(args))) };
            let moos = match via {
                Via::Itself | Via::Lines => String::new(),
                Via::Moos(None) => " moos=\"true\"".to_owned(),
                Via::Moos(Some(file)) => format!(" moos=\"{}\"", escaped(&file.to_string_lossy())),
            };
            format!(" exec=\"{}\"{args}{moos}", escaped(&exec))
        }
    }
}

fn policy(app: &AppSpec) -> String {
    let Policy { restart, restarts, window_secs, health_secs } = app.policy;
    let limits = match restart {
        Restart::Never => String::new(),
        _ => format!(" restarts=\"{restarts}\" restart-window=\"{window_secs}\""),
    };
    let health = health_secs.map_or(policy::OFF.to_owned(), |secs| secs.to_string());
    format!(" restart=\"{}\"{limits} health=\"{health}\"", restart.word())
}

/// Text as it stands in an attribute or an element.
fn escaped(text: &str) -> String {
    text.chars().fold(String::new(), |mut done, c| {
        match c {
            '&' => done += "&amp;",
            '<' => done += "&lt;",
            '>' => done += "&gt;",
            '"' => done += "&quot;",
            '\n' | '\r' | '\t' => {
                // Writing to a String cannot fail.
                let _ = write!(done, "&#{};", u32::from(c));
            }
            c => done.push(c),
        }
        done
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_of_xml_are_escaped() {
        assert_eq!(escaped("a<b & \"c\"\n"), "a&lt;b &amp; &quot;c&quot;&#10;");
    }
}
