//! Behaviours of the agent, on worlds small enough to know the answer.

mod exactness;
mod learning;
mod session;
mod worlds;
