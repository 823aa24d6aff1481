//! Mail: numbers, texts, names and types.

use elk_bus::{Key, Value, any};

use crate::blob::{BLOB, Blob, blob};
use crate::common::events::Patience;
use crate::hearing::{hear, settle};
use crate::transport::Transport;

pub fn numbers_and_texts_arrive_as_sent<T: Transport>() {
    let t = T::start("arrive");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register(any("V_*").from("a")).unwrap();
    settle(&mut b);
    a.comms.notify("V_NUMBER", 2.5).unwrap();
    a.comms.notify("V_TEXT", "elks can dance").unwrap();
    a.comms.notify("V_EMPTY", "").unwrap();
    a.comms.flush().unwrap();
    let heard = hear(&mut b, |h| h.len() == 3);
    let expected = [("V_NUMBER", Value::Double(2.5)), ("V_TEXT", "elks can dance".into()), ("V_EMPTY", "".into())];
    for ((key, source, value, _), (expected_key, expected_value)) in heard.iter().zip(&expected) {
        assert_eq!((key.as_str(), source.as_str(), value), (*expected_key, "a", expected_value));
    }
    drop((a, b));
    t.stop();
}

pub fn order_is_kept_and_nothing_lost_however_fast<T: Transport + Sync>() {
    const COUNT: u64 = 50_000;
    let t = T::start("order");
    std::thread::scope(|scope| {
        let mut b = t.connect("b").unwrap();
        b.comms.register(any("N").lossless()).unwrap();
        settle(&mut b);
        for name in ["a1", "a2"] {
            let t = &t;
            scope.spawn(move || {
                let mut a = t.connect(name).unwrap();
                (0..COUNT).for_each(|i| a.comms.notify("N", i as f64).unwrap());
                a.comms.flush().unwrap();
            });
        }
        let heard = hear(&mut b, |h| h.len() as u64 == 2 * COUNT);
        for name in ["a1", "a2"] {
            let of_one = heard.iter().filter(|(_, source, ..)| source == name).map(|(_, _, value, _)| value);
            assert!(of_one.eq((0..COUNT).map(|i| Value::Double(i as f64)).collect::<Vec<_>>().iter()));
        }
        assert_eq!(b.inbox.dropped(), 0);
    });
    t.stop();
}

pub fn a_client_that_never_reads_hurts_nobody<T: Transport>() {
    let t = T::start("slow");
    let (mut a, mut slow) = (t.connect("a").unwrap(), t.connect("slow").unwrap());
    slow.comms.register("N").unwrap();
    slow.comms.flush().unwrap();
    settle(&mut a);
    a.comms.register("N").unwrap();
    let count = 400_000;
    for i in 0..count {
        a.comms.notify("N", f64::from(i)).unwrap();
        if i % 1000 == 0 {
            a.comms.flush().unwrap();
        }
    }
    settle(&mut a);
    let heard = hear(&mut slow, |h| h.last().is_some_and(|(_, _, v, _)| *v == Value::Double(f64::from(count - 1))));
    assert!(slow.inbox.dropped() > 0, "its mailbox is bounded");
    assert_eq!(heard.len() as u64 + slow.inbox.dropped(), count as u64, "every drop is counted");
    drop((a, slow));
    t.stop();
}

/// Regression: a quarter of them was dropped before the reader came to read them.
pub fn a_late_reader_of_100_000_variables_is_given_all_of_them<T: Transport>() {
    const COUNT: usize = 100_000;
    let t = T::start("many");
    let mut a = t.connect("a").unwrap();
    (0..COUNT).for_each(|i| a.comms.notify(&format!("VARIABLE_{i}"), i as f64).unwrap());
    settle(&mut a);
    assert!(a.inbox.take_refusals().is_empty());
    let mut late = t.connect("late").unwrap();
    late.comms.register("VARIABLE_*").unwrap();
    let heard = hear(&mut late, |h| h.len() >= COUNT);
    let numbers: std::collections::BTreeSet<String> = heard.into_iter().map(|(key, ..)| key).collect();
    assert_eq!((numbers.len(), late.inbox.dropped()), (COUNT, 0));
    drop((a, late));
    t.stop();
}

/// Regression: a text of 1.1 GB was taken, and then the broker let go of its writer.
pub fn long_texts_arrive_and_what_is_too_long_is_refused_at_once<T: Transport>() {
    let t = T::start("texts");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register("TEXT").unwrap();
    settle(&mut b);
    let text = "long ".repeat(1 << 20);
    for _ in 0..3 {
        a.comms.notify("TEXT", text.as_str()).unwrap();
        a.comms.flush().unwrap();
        let heard = hear(&mut b, |h| !h.is_empty());
        assert!(heard.iter().all(|(.., value, _)| matches!(value, Value::Text(got) if *got == text)));
    }
    let name = "N".repeat(300);
    let refused = a.comms.notify(&name, 1.0).unwrap_err().to_string();
    assert!(refused.contains("a name of 300 bytes; at most 256 are allowed"), "{refused}");
    let refused = a.comms.register(&name).unwrap_err().to_string();
    assert!(refused.contains("at most 256"), "{refused}");
    a.comms.notify("TEXT", "short").unwrap();
    a.comms.flush().unwrap();
    hear(&mut b, |h| h.iter().any(|(.., value, _)| *value == Value::Text("short".into())));
    drop((a, b));
    t.stop();
}

pub fn a_value_of_another_type_is_refused_to_its_writer_and_never_misread<T: Transport>() {
    let t = T::start("types");
    let (mut a, mut b) = (t.connect("a").unwrap(), t.connect("b").unwrap());
    b.comms.register(&BLOB).unwrap();
    b.comms.register("NUMBER").unwrap();
    settle(&mut b);
    a.comms.notify("BLOB", "not a blob").unwrap();
    a.comms.publish(&BLOB, &blob(1, 10)).unwrap();
    a.comms.notify("NUMBER", 1.0).unwrap();
    a.comms.publish(&Key::<Blob>::named("NUMBER"), &blob(1, 20_000)).unwrap();
    settle(&mut a);
    let refusals: Vec<String> = a.inbox.take_refusals().into_iter().map(|refused| refused.reason).collect();
    assert_eq!(refusals.len(), 2, "{refusals:?}");
    assert!(refusals[0].contains("b reads BLOB as Blob (layout") && refusals[0].contains("texts was refused"));
    assert!(refusals[1].contains("NUMBER carries numbers since its first write; Blob"), "{refusals:?}");
    let (mut said, patience) = (Vec::new(), Patience::new());
    while said.len() < 2 {
        let decode = |m: &elk_bus::Mail<'_>| m.decode(&Key::<Blob>::named(m.key().to_owned())).map(|blob| blob.number);
        b.receive(patience.left("two values"), |m| said.push(decode(m).map_err(|e| e.to_string()))).unwrap();
    }
    let wrong = "NUMBER carries the number 1, but Blob was expected: do writer and reader mean the same variable?";
    assert_eq!(said, [Ok(1), Err(wrong.to_owned())]);
    drop((a, b));
    t.stop();
}
