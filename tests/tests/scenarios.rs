//! Mistakes in scenario files.

use sarah_sim::scenario::Scenario;

const HEAD: &str = "duration_s = 7.0\ndrop_m = 0.1\nsettle_s = 1.0\n";

/// The one line the user gets.
fn complaint(tail: &str) -> String {
    let line = Scenario::parse("mine.toml", &format!("{HEAD}{tail}")).expect_err("a mistake").to_string();
    assert_eq!(line.trim().lines().count(), 1, "{line}");
    line
}

#[test]
fn a_value_that_is_no_number_or_negative_is_refused_in_one_line_that_names_it() {
    let nan = "[pushes.grid]\nat_s = 1.0\nimpulse_n_s = nan\ndirections = 24\n";
    let line = complaint(nan);
    assert!(line.contains("pushes.grid.impulse_n_s") && line.contains("NaN"), "{line}");
    let negative = "[pushes.random]\nfirst_s = [1.0, 2.0]\ngap_s = [1.0, 2.0]\nimpulse_n_s = [-3.0, 24.0]\n";
    let line = complaint(negative);
    assert!(line.contains("pushes.random.impulse_n_s") && line.contains("-3"), "{line}");
    let backwards = "[pushes.random]\nfirst_s = [2.0, 1.0]\ngap_s = [1.0, 2.0]\nimpulse_n_s = [3.0, 24.0]\n";
    let line = complaint(backwards);
    assert!(line.contains("pushes.random.first_s"), "{line}");
}

#[test]
fn a_scenario_that_does_not_exist_is_refused_in_one_line_that_lists_those_that_do() {
    let line = Scenario::load("psuh-grid").expect_err("no such scenario").to_string();
    assert_eq!(line.lines().count(), 1, "{line}");
    assert!(line.contains("push-grid"), "{line}");
}

#[test]
fn an_unknown_key_is_refused_in_one_line_that_names_it() {
    let line = complaint("durations = 3.0\n");
    assert!(line.contains("mine.toml: line 4") && line.contains("durations"), "{line}");
    let line = complaint("[pushes.grid]\nat_s = 1.0\nimpulse_n_s = 18.0\nforce_n = 180.0\ndirections = 24\n");
    assert!(line.contains("mine.toml") && line.contains("force_n"), "{line}");
}

#[test]
fn text_that_is_no_toml_is_refused_in_one_line_with_file_and_line_number() {
    let line = complaint("pushes = [[");
    assert!(line.contains("mine.toml") && line.contains("line 4"), "{line}");
}
