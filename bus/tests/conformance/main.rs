//! What every transport has to do, run on each of them.

mod blob;
mod broker_death;
mod bulk;
mod clock;
#[path = "../common/mod.rs"]
mod common;
mod count;
mod event_loop;
mod hearing;
mod mail;
mod strangers;
mod succession;
mod transport;

/// Not a test by itself: the broker's process.
#[test]
fn broker_process() {
    common::serve_if_asked_to();
}

macro_rules! conformance {
    ($($theme:ident: $($test:ident),*;)*) => {
        mod memory { $($(#[test] fn $test() { crate::$theme::$test::<crate::transport::Memory>() })*)* }
        mod shm { $($(#[test] fn $test() { crate::$theme::$test::<crate::transport::Shm>() })*)* }
    };
}

conformance! {
    mail: numbers_and_texts_arrive_as_sent, order_is_kept_and_nothing_lost_however_fast, a_client_that_never_reads_hurts_nobody, a_late_reader_of_100_000_variables_is_given_all_of_them, long_texts_arrive_and_what_is_too_long_is_refused_at_once, a_value_of_another_type_is_refused_to_its_writer_and_never_misread;
    strangers: whoever_has_never_seen_a_type_reads_its_values, a_description_that_comes_late_is_heard_of, two_builds_of_a_type_are_told_where_they_differ,
        versions_of_a_type_that_differ_in_defaults_are_read_by_each_other,
        a_newer_writer_of_an_old_name_is_heard_of_by_who_cannot_read_it,
        a_reader_of_a_third_version_hears_once_of_the_one_that_it_cannot_read;
    bulk: values_of_any_size_arrive_whole_and_in_order, bulk_values_flow_as_fast_as_a_lossless_reader_reads, bulk_values_wait_for_a_lossless_reader_that_hangs_only_so_long, a_late_registrant_is_given_the_latest_value_however_large, whoever_hears_itself_is_heard_by_the_others_as_before;
    succession: bulk_values_for_the_dead_are_kept_for_the_next_of_the_name, a_name_is_taken_once_and_free_again_at_once, the_next_of_a_name_gets_what_the_dead_one_left, a_client_that_leaves_in_good_order_leaves_nothing, mail_goes_on_with_a_successor_at_a_message_boundary, a_successor_that_dies_before_it_is_ready_changes_nothing;
    broker_death: clients_are_told_that_the_broker_is_gone, a_broker_may_die_and_nothing_is_lost_or_heard_twice, what_was_left_by_those_who_are_gone_outlives_brokers, bulk_values_survive_the_broker;
    clock: a_driven_clock_is_everybodys_through_a_brokers_death_and_ends_with_its_driver;
    event_loop: who_sleeps_on_the_descriptor_hears_all_of_it_through_a_brokers_death, the_descriptor_is_readable_only_while_there_is_something;
}
