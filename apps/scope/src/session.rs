//! A scope's place in the community: a client like any other, that asks the broker for its table.

use std::time::Duration;

use elk_bus::broker::table::{CommunityTable, REQUEST, TABLE, VariableEntry};
use elk_bus::clock::Stopwatch;
use elk_bus::{Client, CommsError, Community, ConnectError, Mail, Refused, Running, any, running};
use elk_mission::{instead, nearest};

use crate::error::ScopeError;
use crate::pattern::Pattern;

/// How long the broker gets to answer.
const PATIENCE: Duration = Duration::from_secs(15);
/// The longest that a scope sleeps without looking whether it is to end.
pub(crate) const LOOK_EVERY: Duration = Duration::from_millis(100);

/// A client that looks.
pub struct Scope {
    pub(crate) client: Client,
}

impl Scope {
    /// Joins a community of this machine, as a client whose name begins with `command`.
    ///
    /// # Errors
    /// There is no such community (the error names those that there are), or it is another user's.
    pub fn join(community: &Community, command: &str) -> Result<Self, ScopeError> {
        match Client::connect(community, &format!("{command}-{}", std::process::id())) {
            Ok(client) => Ok(Self::over(client)),
            Err(ConnectError::NoBroker(community)) => {
                Err(ScopeError::NoCommunity { community, instead: instead_of_none(&running().unwrap_or_default()) })
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Looks through a client that has joined already.
    pub fn over(client: Client) -> Self {
        Self { client }
    }

    /// The name that the broker knows this scope by.
    pub fn name(&self) -> &str {
        self.client.comms.name()
    }

    /// Asks the broker who is there and what was said. The scope itself is left out.
    ///
    /// Everything that this client sent before has been taken in or refused when the answer comes; mail that comes
    /// meanwhile is not kept.
    pub fn table(&mut self) -> Result<CommunityTable, ScopeError> {
        self.table_within(PATIENCE)
    }

    /// As [`Scope::table`], with another patience.
    pub(crate) fn table_within(&mut self, patience: Duration) -> Result<CommunityTable, ScopeError> {
        self.client.comms.notify(REQUEST, "")?;
        let (waited, mut answer) = (Stopwatch::start(), None);
        let mut table = loop {
            if let Some(answer) = answer {
                break answer?;
            }
            if waited.elapsed() > patience {
                return Err(ScopeError::Silent(self.client.comms.community().into()));
            }
            self.client.receive(LOOK_EVERY, |mail| {
                if mail.is(&TABLE) {
                    answer = Some(mail.decode(&TABLE));
                }
            })?;
        };
        leave_out(&mut table, self.name());
        Ok(table)
    }

    /// Registers for variables.
    pub(crate) fn register(&mut self, keys: &[Pattern], source: &Pattern) -> Result<(), ScopeError> {
        for key in keys {
            self.client.comms.register(any(key.as_str()).from(source.as_str()))?;
        }
        Ok(self.client.comms.flush()?)
    }

    /// Waits for mail.
    pub(crate) fn receive(
        &mut self,
        timeout: Duration,
        mut on_mail: impl FnMut(&Mail<'_>),
    ) -> Result<usize, CommsError> {
        self.client.receive(timeout, |mail| {
            // A question that a dead broker has answered may be answered by the next one, too.
            if !mail.is(&TABLE) {
                on_mail(mail);
            }
        })
    }

    /// Messages that were dropped because this scope did not read.
    pub(crate) fn missed(&self) -> u64 {
        self.client.inbox.dropped()
    }

    pub(crate) fn take_refusals(&mut self) -> Vec<Refused> {
        self.client.inbox.take_refusals()
    }
}

fn instead_of_none(running: &[Running]) -> String {
    let names: Vec<&str> = running.iter().filter(|one| one.is_own()).map(|one| one.community.as_str()).collect();
    match names.as_slice() {
        [] => "start one with `elk launch MISSION`, or a broker alone with `elk db`".to_owned(),
        names => format!("running are {} (choose one with --community)", names.join(", ")),
    }
}

fn leave_out(table: &mut CommunityTable, own_name: &str) {
    table.clients.retain(|client| client.name != own_name);
    for route in table.variables.iter_mut().flat_map(|variable| &mut variable.routes) {
        route.readers.retain(|reader| reader != own_name);
    }
}

/// The variables that match, by name.
///
/// # Errors
/// The pattern is a name, and nobody has written a variable of this name.
pub(crate) fn matching<'a>(table: &'a CommunityTable, pattern: &Pattern) -> Result<Vec<&'a VariableEntry>, ScopeError> {
    let mut found: Vec<_> = table.variables.iter().filter(|variable| pattern.matches(&variable.name)).collect();
    found.sort_by(|one, other| one.name.cmp(&other.name));
    match pattern.literal() {
        Some(name) if found.is_empty() => Err(unknown_variable(table, name)),
        _ => Ok(found),
    }
}

pub(crate) fn unknown_variable(table: &CommunityTable, name: &str) -> ScopeError {
    let names: Vec<&str> = table.variables.iter().map(|variable| variable.name.as_str()).collect();
    unknown("nobody has written a variable", name, &names)
}

/// Nobody has the name; those who are there are only named if they are few.
pub(crate) fn unknown(what: &'static str, name: &str, names: &[&str]) -> ScopeError {
    const FEW: usize = 10;
    let instead = match names.len() > FEW && nearest(name, names.iter().copied()).is_none() {
        true => "`elk list` shows what there is".to_owned(),
        false => instead(name, names),
    };
    ScopeError::Unknown { what, name: name.into(), instead }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::MetadataExt;

    use elk_bus::Owner;

    use super::*;

    #[test]
    fn a_few_names_are_listed_and_many_are_not() {
        let said = |names: &[&str]| unknown("there is no", "PATH", names).to_string();
        assert_eq!(said(&["SCAN", "PLAN"]), "there is no PATH; known: SCAN, PLAN");
        assert_eq!(said(&["PAHT"; 20]), "there is no PATH; did you mean PAHT?");
        assert_eq!(said(&["SCAN"; 20]), "there is no PATH; `elk list` shows what there is");
    }

    #[test]
    fn the_communities_that_run_are_named_instead() {
        let own = std::fs::metadata("/proc/self").unwrap().uid();
        let one = |name: &str, user| Running {
            community: Community::new(name).unwrap(),
            broker: Some(Owner { process: 1, user }),
        };
        assert_eq!(
            instead_of_none(&[one("lab", own), one("theirs", own + 1), one("kitchen", own)]),
            "running are lab, kitchen (choose one with --community)"
        );
        assert!(instead_of_none(&[one("theirs", own + 1)]).contains("elk launch"));
    }
}
