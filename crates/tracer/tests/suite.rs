//! Tests of whole pictures: closed forms, agreement between estimators, identical bytes, agreement with Mitsuba.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

mod suite {
    mod estimators;
    mod known_light;
    mod lamps;
    mod repaint;
    mod split;
    mod views;
}
