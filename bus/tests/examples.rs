//! The examples run, and come to what they say.

#[path = "../examples/hello.rs"]
mod hello;
#[path = "../examples/successor.rs"]
mod successor;

#[test]
fn one_says_where_it_is_and_the_other_hears_it() {
    hello::main().unwrap();
}

#[test]
fn what_an_app_has_learned_goes_on_with_the_next_one() {
    successor::main().unwrap();
}
