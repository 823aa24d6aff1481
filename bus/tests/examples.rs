//! The examples run, and come to what they say.

#[path = "../examples/beacon.rs"]
mod beacon;
#[path = "../examples/described.rs"]
mod described;
#[path = "../examples/event_loop.rs"]
mod event_loop;
#[path = "../examples/hello.rs"]
mod hello;
#[path = "../examples/question.rs"]
mod question;
#[path = "../examples/successor.rs"]
mod successor;

#[test]
fn an_app_draws_and_takes_a_key() {
    beacon::main().unwrap();
}

#[test]
fn one_says_where_it_is_and_the_other_hears_it() {
    hello::main().unwrap();
}

#[test]
fn what_an_app_has_learned_goes_on_with_the_next_one() {
    successor::main().unwrap();
}

#[test]
fn a_question_is_answered() {
    question::main().unwrap();
}

#[test]
fn mail_and_a_socket_are_waited_for_in_one_loop() {
    event_loop::main().unwrap();
}

#[test]
fn a_type_that_nobody_knows_is_read_field_by_field() {
    described::main().unwrap();
}
