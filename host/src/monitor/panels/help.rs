//! The help.

use ratatui::text::Line;

use crate::link::live::Role;

const KEYS: &str = "
 a        arm: asks first; the robot may then step at once
 space s  emergency stop: at once, without a question, latched
 d        disarm: brakes on
 c        clear the emergency stop; the robot stays braked until armed
 q        quit; the robot goes on as it is
 ?        this help, and back
";

const WATCHING: &str = "
 space s  emergency stop: at once, without a question, latched
 q        quit; the robot goes on as it is
 ?        this help, and back
 This monitor only watches: to arm, start it without --observe.
";

const LEGEND: &str = "
 Factor    above 0.07 (┊) with both feet loaded starts a step;
           its course below it is 0.1 s a column
 feet      a foot is loaded above 15 N, heel and toe together
 bubble    the trunk from above: up is forward, the rim is 0.2 rad
 applied   in force; staged: held by the nodes, not in force;
           stored: in memory, in force after power comes up
 STALE     its host is silent: after 10 s the stored set returns
 energy    estimated from movements, not measured
 Without this monitor the robot goes on balancing. A set that is
 not stored goes with its last host: `sarah params commit` keeps it.
";

pub(in super::super) fn lines(role: Role) -> Vec<Line<'static>> {
    let keys = if role == Role::Writer { KEYS } else { WATCHING };
    keys.lines().chain(LEGEND.lines()).map(Line::raw).collect()
}
