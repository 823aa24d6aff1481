//! `elk communities`: what runs on this machine.

use std::time::Duration;

use elk_bus::broker::table::CommunityTable;
use elk_bus::{Running, running};
use serde_json::{Value, json};

use crate::error::ScopeError;
use crate::output::{Line, Output, Table};
use crate::session::Scope;
use crate::show;

/// How long a community gets to say who is there.
const PATIENCE: Duration = Duration::from_secs(2);

/// A community, and its table if this user may join it and it answers.
type Seen = (Running, Option<CommunityTable>);

/// Lists all communities of this machine; those of other users with what the kernel knows of them.
pub fn communities(output: &mut Output<'_>, json: bool) -> Result<(), ScopeError> {
    let found = running().map_err(ScopeError::Sockets)?;
    let seen = look_into_all(found);
    match json {
        true => output.json(&json!({"communities": seen.iter().map(as_json).collect::<Vec<_>>()}))?,
        false => as_text(&seen, output.columns()).iter().try_for_each(|line| output.styled(line))?,
    }
    output.flush()
}

/// All at the same time: one that does not answer is waited for, and the others not behind it.
fn look_into_all(found: Vec<Running>) -> Vec<Seen> {
    std::thread::scope(|threads| {
        let looks: Vec<_> = found.iter().map(|one| threads.spawn(move || look_into(one))).collect();
        let tables: Vec<_> = looks.into_iter().map(|look| look.join().unwrap_or(None)).collect();
        found.iter().cloned().zip(tables).collect()
    })
}

/// `None`: not this user's, or it ended just now, or does not answer; it is listed all the same.
fn look_into(one: &Running) -> Option<CommunityTable> {
    let mut scope = one.is_own().then(|| Scope::join(&one.community, "communities").ok())??;
    scope.table_within(PATIENCE).ok()
}

fn as_text(seen: &[Seen], columns: Option<usize>) -> Vec<Line> {
    if seen.is_empty() {
        return vec!["no community runs on this machine: `elk launch MISSION` starts one".to_owned().into()];
    }
    let mut rows = vec![["COMMUNITY", "USER", "PROCESS", "UP", "CLIENTS"].map(str::to_owned).to_vec()];
    rows.extend(seen.iter().map(row));
    Table { rows, right: &[2, 3], spare: &[2, 1, 3], ..Table::default() }.lines(columns)
}

fn row((one, table): &Seen) -> Vec<String> {
    let (up, clients) = match table {
        Some(table) => (show::duration(table.time - table.started), show::names(&names(table), " ")),
        None => ("-".to_owned(), why_not(one).to_owned()),
    };
    let user = one.broker.map_or_else(|| "-".to_owned(), |broker| user_name(broker.user));
    let process = one.broker.map_or_else(|| "-".to_owned(), |broker| broker.process.to_string());
    vec![one.community.to_string(), user, process, up, clients]
}

fn why_not(one: &Running) -> &'static str {
    match one.broker {
        None => "(more connections wait than it takes in)",
        Some(_) if one.is_own() => "(it does not answer)",
        Some(_) => "(another user's: only that user can join)",
    }
}

fn names(table: &CommunityTable) -> Vec<&str> {
    table.clients.iter().map(|client| client.name.as_str()).collect()
}

fn as_json((one, table): &Seen) -> Value {
    json!({
        "community": one.community.as_str(),
        "user": one.broker.map(|broker| user_name(broker.user)),
        "user_id": one.broker.map(|broker| broker.user),
        "own": one.is_own(),
        "process": one.broker.map(|broker| broker.process),
        "uptime_secs": table.as_ref().map(|table| table.time - table.started),
        "clients": table.as_ref().map(names),
    })
}

/// The name that the machine's table of users has for a number, or the number.
fn user_name(user: u32) -> String {
    let users = std::fs::read_to_string("/etc/passwd").unwrap_or_default();
    named_in(&users, user).map_or_else(|| user.to_string(), str::to_owned)
}

/// Its lines are `name:password:number:…`.
fn named_in(users: &str, user: u32) -> Option<&str> {
    users.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(user)).then_some(name)
    })
}

#[cfg(test)]
mod tests {
    use elk_bus::{Community, Owner};

    use super::*;

    #[test]
    fn other_users_communities_are_listed_as_such() {
        let one = |name: &str, broker| Running { community: Community::new(name).unwrap(), broker };
        let theirs = Some(Owner { process: 7, user: 4_000_000 });
        let table = CommunityTable {
            community: "lab".into(),
            time: 90.0,
            started: 0.0,
            clock: None,
            clients: vec![],
            variables: vec![],
            types: Vec::new(),
            left_out: 0,
        };
        let seen = [(one("lab", theirs), Some(table)), (one("theirs", theirs), None), (one("crowded", None), None)];
        let lines = as_text(&seen, None);
        assert_eq!(lines[1], "lab        4000000        7  90.0 s");
        assert!(lines[2].text.ends_with("(another user's: only that user can join)"), "{lines:?}");
        assert_eq!(as_json(&seen[1])["own"], false);
        assert!(lines[3].text.ends_with("-  (more connections wait than it takes in)"), "{lines:?}");
        assert_eq!(as_json(&seen[2])["process"], Value::Null);
        assert!(as_text(&[], None)[0].text.contains("elk launch"));
    }

    #[test]
    fn users_have_names() {
        let users = "root:x:0:0:root:/root:/bin/sh\nelk:x:1000:1000::/home/elk:/bin/sh\n";
        assert_eq!((named_in(users, 1000), named_in(users, 7)), (Some("elk"), None));
    }
}
