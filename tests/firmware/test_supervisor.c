// Specification of supervisor.c: every state, every way in and out, the dead-man, and who outranks whom.
#include <setjmp.h> // cmocka
#include <stdarg.h> // cmocka
#include <stddef.h> // cmocka
#include <stdint.h> // cmocka

#include <cmocka.h> // the test framework

#include "supervisor.h" // what is specified here

#define NONCE 0xC0FFEE11u
#define TICK_US 5000u

static struct {
    struct supervisor supervisor;
    struct supervisor_senses senses;
    uint32_t now_us;
} rig;

static int fresh(void **state)
{
    (void)state;
    supervisor_init(&rig.supervisor, NONCE, RESET_POWER_ON);
    supervisor_watch_battery(&rig.supervisor, 6400);
    rig.senses = (struct supervisor_senses){.battery_mv = 7400, .wheels_still = true};
    rig.now_us = UINT32_MAX - 150000; // the clock wraps during most of these tests
    return 0;
}

static void ticks(unsigned count)
{
    while (count-- > 0) {
        rig.now_us += TICK_US;
        supervisor_tick(&rig.supervisor, rig.now_us, &rig.senses);
    }
}

static uint8_t hello(void)
{
    return supervisor_hello(&rig.supervisor, PROTOCOL_VERSION, SCHEMA_HASH);
}

static uint8_t drive_for(uint32_t us)
{
    return supervisor_drive(&rig.supervisor, rig.now_us, rig.now_us + us);
}

static void expect(uint8_t state, uint8_t fault)
{
    assert_int_equal(rig.supervisor.state, state);
    assert_int_equal(rig.supervisor.fault, fault);
}

static bool may_run(void)
{
    return supervisor_may_run(&rig.supervisor);
}

static int driving(void **state)
{
    fresh(state);
    ticks(1);
    hello();
    drive_for(DEAD_MAN_US);
    rig.senses.wheels_still = false;
    ticks(1);
    return 0;
}

static int link_lost(void **state)
{
    driving(state);
    ticks(100);
    return 0;
}

// --- From reset to driving -------------------------------------------------------------------------

static void after_reset_nothing_moves_until_a_host_has_said_hello(void **state)
{
    (void)state;
    expect(STATE_BOOT, FAULT_NONE);
    ticks(1000);
    expect(STATE_BOOT, FAULT_NONE);
    assert_int_equal(drive_for(100000), REFUSED_NO_SESSION);
    assert_false(may_run());
    assert_int_equal(hello(), 0);
    expect(STATE_READY, FAULT_NONE);
    assert_false(may_run());
}

static void a_host_with_another_schema_or_version_is_refused(void **state)
{
    (void)state;
    assert_int_equal(supervisor_hello(&rig.supervisor, PROTOCOL_VERSION, SCHEMA_HASH ^ 1u), REFUSED_SCHEMA);
    assert_int_equal(supervisor_hello(&rig.supervisor, PROTOCOL_VERSION + 1, SCHEMA_HASH), REFUSED_SCHEMA);
    expect(STATE_BOOT, FAULT_NONE);
    assert_int_equal(drive_for(100000), REFUSED_NO_SESSION);
}

static void a_foreign_host_ends_the_session_of_the_one_before(void **state)
{
    (void)state;
    supervisor_hello(&rig.supervisor, PROTOCOL_VERSION, SCHEMA_HASH ^ 1u);
    expect(STATE_BOOT, FAULT_NONE);
    assert_false(may_run());
    assert_int_equal(drive_for(100000), REFUSED_NO_SESSION);
}

static void a_standing_robot_may_wait_in_silence_as_long_as_it_likes(void **state)
{
    (void)state;
    hello();
    ticks(10000);
    expect(STATE_READY, FAULT_NONE);
    assert_int_equal(drive_for(100000), 0);
    assert_true(may_run());
}

// --- Setpoints and the dead-man --------------------------------------------------------------------

static void a_setpoint_dies_at_its_deadline_and_the_motors_with_it(void **state)
{
    (void)state;
    assert_int_equal(drive_for(4 * TICK_US), 0);
    ticks(3);
    assert_true(may_run());
    ticks(1);
    assert_false(may_run());
    expect(STATE_DRIVING, FAULT_NONE);
}

static void a_drive_that_comes_a_little_late_goes_on(void **state)
{
    (void)state;
    drive_for(4 * TICK_US);
    ticks(38);
    assert_false(may_run());
    assert_int_equal(drive_for(4 * TICK_US), 0);
    assert_true(may_run());
}

static void silence_is_latched_as_link_lost_before_200_ms_have_passed(void **state)
{
    (void)state;
    drive_for(DRIVE_AHEAD_MAX_US); // however long the host wished
    ticks(38);
    assert_true(may_run());
    ticks(1);
    assert_false(may_run());
    expect(STATE_FAULT, FAULT_LINK_LOST);
    ticks(1000);
    expect(STATE_FAULT, FAULT_LINK_LOST);
    assert_int_equal(drive_for(100000), REFUSED_FAULT_LATCHED);
    assert_false(may_run());
}

static void a_setpoint_that_came_too_late_or_from_a_lost_clock_is_refused(void **state)
{
    (void)state;
    ticks(30);
    assert_int_equal(drive_for(0), REFUSED_EXPIRED);
    assert_int_equal(drive_for((uint32_t)-1000), REFUSED_EXPIRED);
    assert_int_equal(drive_for(DRIVE_AHEAD_MAX_US + 1), REFUSED_BAD_VALUE);
    assert_true(may_run()); // they changed nothing, and renewed nothing:
    ticks(8);
    expect(STATE_FAULT, FAULT_LINK_LOST);
}

// --- Moves -----------------------------------------------------------------------------------------

static uint8_t move_for(uint32_t us)
{
    return supervisor_move(&rig.supervisor, rig.now_us, rig.now_us + us);
}

static uint8_t keep_alive_for(uint32_t us)
{
    return supervisor_keep_alive(&rig.supervisor, rig.now_us, rig.now_us + us);
}

static int moving(void **state)
{
    fresh(state);
    ticks(1);
    hello();
    move_for(100000);
    ticks(1);
    return 0;
}

static void a_move_begins_only_where_the_robot_stands_ready(void **state)
{
    assert_int_equal(move_for(100000), REFUSED_NO_SESSION);
    hello();
    assert_int_equal(move_for(0), REFUSED_EXPIRED);
    assert_int_equal(move_for(DRIVE_AHEAD_MAX_US + 1), REFUSED_BAD_VALUE);
    expect(STATE_READY, FAULT_NONE);
    assert_int_equal(move_for(100000), 0);
    expect(STATE_MOVING, FAULT_NONE);
    assert_true(may_run());
    assert_int_equal(move_for(100000), REFUSED_NOT_STANDING);
    driving(state);
    assert_int_equal(move_for(100000), REFUSED_NOT_STANDING);
    supervisor_stop(&rig.supervisor, STOP_BRAKE);
    assert_int_equal(move_for(100000), REFUSED_NOT_STANDING);
    supervisor_estop(&rig.supervisor);
    assert_int_equal(move_for(100000), REFUSED_FAULT_LATCHED);
}

static void a_move_lives_as_long_as_it_is_kept_alive(void **state)
{
    (void)state;
    for (int i = 0; i < 50; i++) {
        ticks(10);
        assert_true(may_run());
        assert_int_equal(keep_alive_for(100000), 0);
    }
    ticks(20);
    assert_false(may_run()); // at its deadline
    expect(STATE_MOVING, FAULT_NONE);
    assert_int_equal(keep_alive_for(100000), 0);
    assert_true(may_run()); // it was not too late
    ticks(39);
    expect(STATE_FAULT, FAULT_LINK_LOST);
    assert_int_equal(keep_alive_for(100000), 0); // of a move that is no more
    expect(STATE_FAULT, FAULT_LINK_LOST);
}

static void a_keep_alive_itself_may_come_too_late(void **state)
{
    (void)state;
    assert_int_equal(keep_alive_for(0), REFUSED_EXPIRED);
    assert_int_equal(keep_alive_for(DRIVE_AHEAD_MAX_US + 1), REFUSED_BAD_VALUE);
    ticks(20);
    assert_false(may_run());
}

static void a_keep_alive_starts_nothing(void **state)
{
    (void)state;
    hello();
    assert_int_equal(keep_alive_for(100000), 0);
    expect(STATE_READY, FAULT_NONE);
    assert_false(may_run());
}

static void a_move_at_its_end_leaves_the_robot_ready(void **state)
{
    (void)state;
    supervisor_move_ended(&rig.supervisor);
    expect(STATE_READY, FAULT_NONE);
    assert_false(may_run());
    supervisor_move_ended(&rig.supervisor); // nothing to end
    expect(STATE_READY, FAULT_NONE);
}

static void stop_and_drive_and_a_foreign_host_end_a_move(void **state)
{
    supervisor_stop(&rig.supervisor, STOP_BRAKE);
    expect(STATE_STOPPED, FAULT_NONE);
    moving(state);
    assert_int_equal(drive_for(100000), 0);
    expect(STATE_DRIVING, FAULT_NONE);
    moving(state);
    supervisor_hello(&rig.supervisor, PROTOCOL_VERSION, SCHEMA_HASH ^ 1u);
    expect(STATE_BOOT, FAULT_NONE);
}

static void a_battery_that_is_no_longer_watched_is_no_longer_low(void **state)
{
    fresh(state);
    hello();
    rig.senses.battery_mv = 1; // a board on USB alone
    ticks(110);
    expect(STATE_FAULT, FAULT_BATTERY_LOW);
    supervisor_watch_battery(&rig.supervisor, 0);
    ticks(1);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
    expect(STATE_READY, FAULT_NONE);
    ticks(300);
    expect(STATE_READY, FAULT_NONE);
}

static void a_session_that_opens_while_the_wheels_turn_is_ready_only_when_they_stand(void **state)
{
    driving(state);
    supervisor_hello(&rig.supervisor, PROTOCOL_VERSION, SCHEMA_HASH ^ 1u);
    hello();
    expect(STATE_STOPPED, FAULT_NONE);
    assert_false(supervisor_stands(&rig.supervisor));
    assert_int_equal(supervisor_move(&rig.supervisor, rig.now_us, rig.now_us + 100000), REFUSED_NOT_STANDING);
    rig.senses.wheels_still = true;
    ticks(1);
    expect(STATE_READY, FAULT_NONE);
}

// --- Stop ------------------------------------------------------------------------------------------

static void stop_ends_driving_at_once_and_is_ready_when_the_wheels_stand(void **state)
{
    (void)state;
    supervisor_stop(&rig.supervisor, STOP_BRAKE);
    expect(STATE_STOPPED, FAULT_NONE);
    assert_false(may_run());
    ticks(100);
    expect(STATE_STOPPED, FAULT_NONE);
    rig.senses.wheels_still = true;
    ticks(1);
    expect(STATE_READY, FAULT_NONE);
}

static void a_stopping_robot_may_be_driven_on(void **state)
{
    (void)state;
    supervisor_stop(&rig.supervisor, STOP_BRAKE);
    assert_int_equal(drive_for(100000), 0);
    assert_true(may_run());
}

static void stop_may_leave_the_motors_open_until_something_else_is_said(void **state)
{
    (void)state;
    supervisor_stop(&rig.supervisor, STOP_COAST);
    assert_true(supervisor_coasts(&rig.supervisor));
    ticks(100);
    assert_true(supervisor_coasts(&rig.supervisor));
    drive_for(100000);
    assert_false(supervisor_coasts(&rig.supervisor));
    supervisor_stop(&rig.supervisor, STOP_COAST);
    supervisor_stop(&rig.supervisor, STOP_BRAKE);
    assert_false(supervisor_coasts(&rig.supervisor));
    supervisor_stop(&rig.supervisor, 77); // no way to stop: brake
    assert_false(supervisor_coasts(&rig.supervisor));
}

static void a_fault_brakes_and_goes_on_braking(void **state)
{
    (void)state;
    supervisor_stop(&rig.supervisor, STOP_COAST);
    supervisor_estop(&rig.supervisor);
    assert_false(supervisor_coasts(&rig.supervisor));
    supervisor_stop(&rig.supervisor, STOP_COAST);
    assert_false(supervisor_coasts(&rig.supervisor));
    supervisor_clear(&rig.supervisor, NONCE);
    assert_false(supervisor_coasts(&rig.supervisor));
}

static void nobody_without_a_session_opens_the_motors(void **state)
{
    (void)state;
    supervisor_stop(&rig.supervisor, STOP_COAST);
    assert_false(supervisor_coasts(&rig.supervisor));
}

static void a_robot_stands_when_ready_or_still_in_a_fault(void **state)
{
    assert_false(supervisor_stands(&rig.supervisor)); // BOOT
    ticks(1);
    hello();
    assert_true(supervisor_stands(&rig.supervisor));
    supervisor_estop(&rig.supervisor);
    assert_true(supervisor_stands(&rig.supervisor));
    rig.senses.wheels_still = false;
    ticks(1);
    assert_false(supervisor_stands(&rig.supervisor));
    driving(state);
    assert_false(supervisor_stands(&rig.supervisor));
}

static void stop_neither_clears_a_fault_nor_opens_a_session(void **state)
{
    (void)state;
    supervisor_stop(&rig.supervisor, STOP_BRAKE);
    expect(STATE_FAULT, FAULT_LINK_LOST);
    fresh(state);
    supervisor_stop(&rig.supervisor, STOP_BRAKE);
    expect(STATE_BOOT, FAULT_NONE);
}

// --- E-stop ----------------------------------------------------------------------------------------

static void an_estop_is_honoured_in_every_state(void **state)
{
    int (*const ways_in[])(void **) = {fresh, driving, link_lost};
    for (size_t i = 0; i < sizeof ways_in / sizeof ways_in[0]; i++) {
        ways_in[i](state);
        supervisor_estop(&rig.supervisor);
        expect(STATE_FAULT, FAULT_ESTOP_FRAME);
        assert_false(may_run());
        ticks(1000);
        expect(STATE_FAULT, FAULT_ESTOP_FRAME);
    }
}

static void the_button_holds_the_fault_until_it_is_released_and_cleared(void **state)
{
    (void)state;
    rig.senses.estop_pressed = true;
    ticks(1);
    expect(STATE_FAULT, FAULT_ESTOP_BUTTON);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), REFUSED_FAULT_PERSISTS);
    rig.senses.estop_pressed = false;
    ticks(100);
    expect(STATE_FAULT, FAULT_ESTOP_BUTTON);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
    expect(STATE_STOPPED, FAULT_NONE);
}

static void a_button_pressed_at_the_first_tick_wins_over_any_hurry(void **state)
{
    (void)state;
    rig.senses.estop_pressed = true;
    hello();
    drive_for(100000);
    ticks(1);
    expect(STATE_FAULT, FAULT_ESTOP_BUTTON);
    assert_false(may_run());
}

// --- Clear -----------------------------------------------------------------------------------------

static void clear_needs_the_nonce_of_this_start(void **state)
{
    (void)state;
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE + 1), REFUSED_BAD_NONCE);
    expect(STATE_FAULT, FAULT_LINK_LOST);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
    expect(STATE_STOPPED, FAULT_NONE); // the wheels have not come to rest
    assert_false(may_run()); // the old setpoint stays dead
    assert_int_equal(drive_for(100000), 0);
}

static void clear_where_nothing_is_wrong_changes_nothing(void **state)
{
    (void)state;
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
    expect(STATE_DRIVING, FAULT_NONE);
    assert_true(may_run());
}

static void clearing_a_fault_without_a_session_leads_back_to_boot(void **state)
{
    (void)state;
    supervisor_estop(&rig.supervisor);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
    expect(STATE_BOOT, FAULT_NONE);
}

static void a_session_opened_during_a_fault_counts_once_it_is_cleared(void **state)
{
    (void)state;
    ticks(1);
    supervisor_estop(&rig.supervisor);
    assert_int_equal(hello(), 0);
    expect(STATE_FAULT, FAULT_ESTOP_FRAME);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
    expect(STATE_READY, FAULT_NONE);
}

// --- Battery ---------------------------------------------------------------------------------------

// Drives on while ticking.
static void drive_ticks(unsigned count)
{
    while (count-- > 0) {
        drive_for(100000);
        ticks(1);
    }
}

static void a_short_sag_is_no_fault_and_half_a_second_is(void **state)
{
    (void)state;
    rig.senses.battery_mv = 6399;
    drive_ticks(99);
    rig.senses.battery_mv = 6400;
    drive_ticks(1);
    rig.senses.battery_mv = 6399;
    drive_ticks(100);
    expect(STATE_DRIVING, FAULT_NONE);
    drive_ticks(1);
    expect(STATE_FAULT, FAULT_BATTERY_LOW);
}

static void a_low_battery_is_cleared_only_when_it_has_clearly_recovered(void **state)
{
    (void)state;
    rig.senses.battery_mv = 6000;
    drive_ticks(102);
    rig.senses.battery_mv = 6400 + SUPERVISOR_BATTERY_RECOVERY_MV - 1;
    ticks(1000);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), REFUSED_FAULT_PERSISTS);
    expect(STATE_FAULT, FAULT_BATTERY_LOW);
    rig.senses.battery_mv++;
    rig.senses.wheels_still = true;
    ticks(1);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
    expect(STATE_READY, FAULT_NONE);
}

static void clearing_another_fault_with_a_low_battery_shows_the_battery(void **state)
{
    (void)state;
    rig.senses.battery_mv = 6000;
    ticks(102);
    expect(STATE_FAULT, FAULT_LINK_LOST); // the first cause is kept
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), REFUSED_FAULT_PERSISTS);
    expect(STATE_FAULT, FAULT_BATTERY_LOW);
}

static void a_battery_that_is_not_measured_or_not_watched_is_never_low(void **state)
{
    (void)state;
    rig.senses.battery_mv = 0;
    drive_ticks(1000);
    expect(STATE_DRIVING, FAULT_NONE);
    rig.supervisor.battery_min_mv = 0;
    rig.senses.battery_mv = 1;
    drive_ticks(1000);
    expect(STATE_DRIVING, FAULT_NONE);
}

// --- Wheels, ticks, watchdog -----------------------------------------------------------------------

static void what_the_watch_finds_is_latched_under_its_own_name(void **state)
{
    const uint8_t found[] = {FAULT_RUNAWAY, FAULT_ENCODER_REVERSED, FAULT_ENCODER_DEAD, FAULT_STALL};
    for (size_t i = 0; i < sizeof found / sizeof found[0]; i++) {
        driving(state);
        rig.senses.wheels = found[i];
        ticks(1);
        expect(STATE_FAULT, found[i]);
        assert_false(may_run());
        rig.senses.wheels = FAULT_NONE;
        ticks(100);
        expect(STATE_FAULT, found[i]);
        assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
    }
}

static void a_wheel_that_still_runs_away_cannot_be_cleared(void **state)
{
    (void)state;
    rig.senses.wheels = FAULT_RUNAWAY;
    ticks(1);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), REFUSED_FAULT_PERSISTS);
    expect(STATE_FAULT, FAULT_RUNAWAY);
    supervisor_estop(&rig.supervisor);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), REFUSED_FAULT_PERSISTS);
    expect(STATE_FAULT, FAULT_RUNAWAY); // shown, now that it is what persists
    rig.senses.wheels = FAULT_NONE;
    ticks(1);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
}

static void a_tick_that_comes_much_too_late_is_an_overrun(void **state)
{
    (void)state;
    rig.now_us += SUPERVISOR_TICK_LATE_US - TICK_US;
    drive_for(100000);
    ticks(1); // the latest that passes
    expect(STATE_DRIVING, FAULT_NONE);
    rig.now_us += SUPERVISOR_TICK_LATE_US - TICK_US + 1;
    drive_for(100000);
    ticks(1);
    expect(STATE_FAULT, FAULT_OVERRUN);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
}

static void the_first_tick_may_come_when_it_likes(void **state)
{
    (void)state;
    rig.now_us += 10000000;
    ticks(1);
    expect(STATE_BOOT, FAULT_NONE);
}

static void a_start_after_the_watchdog_is_a_fault_until_cleared(void **state)
{
    fresh(state);
    supervisor_init(&rig.supervisor, NONCE, RESET_WATCHDOG);
    expect(STATE_FAULT, FAULT_WATCHDOG);
    ticks(10);
    assert_int_equal(hello(), 0);
    assert_int_equal(drive_for(100000), REFUSED_FAULT_LATCHED);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
    expect(STATE_READY, FAULT_NONE); // what HELLO opened is still open
    assert_int_equal(drive_for(100000), 0);
}

static void no_other_reset_is_a_fault(void **state)
{
    (void)state;
    const uint8_t causes[] = {RESET_UNKNOWN, RESET_POWER_ON, RESET_EXTERNAL, RESET_BROWN_OUT};
    for (size_t i = 0; i < sizeof causes / sizeof causes[0]; i++) {
        supervisor_init(&rig.supervisor, NONCE, causes[i]);
        expect(STATE_BOOT, FAULT_NONE);
    }
}

static void clear_leads_to_ready_once_the_wheels_stand_and_to_stopped_before(void **state)
{
    (void)state;
    supervisor_estop(&rig.supervisor);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
    expect(STATE_STOPPED, FAULT_NONE);
    rig.senses.wheels_still = true;
    ticks(1);
    expect(STATE_READY, FAULT_NONE);
    supervisor_estop(&rig.supervisor);
    assert_int_equal(supervisor_clear(&rig.supervisor, NONCE), 0);
    expect(STATE_READY, FAULT_NONE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(after_reset_nothing_moves_until_a_host_has_said_hello, fresh),
        cmocka_unit_test_setup(a_host_with_another_schema_or_version_is_refused, fresh),
        cmocka_unit_test_setup(a_foreign_host_ends_the_session_of_the_one_before, driving),
        cmocka_unit_test_setup(a_standing_robot_may_wait_in_silence_as_long_as_it_likes, fresh),
        cmocka_unit_test_setup(a_setpoint_dies_at_its_deadline_and_the_motors_with_it, driving),
        cmocka_unit_test_setup(a_drive_that_comes_a_little_late_goes_on, driving),
        cmocka_unit_test_setup(silence_is_latched_as_link_lost_before_200_ms_have_passed, driving),
        cmocka_unit_test_setup(a_setpoint_that_came_too_late_or_from_a_lost_clock_is_refused, driving),
        cmocka_unit_test_setup(a_move_begins_only_where_the_robot_stands_ready, fresh),
        cmocka_unit_test_setup(a_move_lives_as_long_as_it_is_kept_alive, moving),
        cmocka_unit_test_setup(a_keep_alive_itself_may_come_too_late, moving),
        cmocka_unit_test_setup(a_keep_alive_starts_nothing, fresh),
        cmocka_unit_test_setup(a_move_at_its_end_leaves_the_robot_ready, moving),
        cmocka_unit_test_setup(stop_and_drive_and_a_foreign_host_end_a_move, moving),
        cmocka_unit_test_setup(stop_may_leave_the_motors_open_until_something_else_is_said, driving),
        cmocka_unit_test_setup(a_fault_brakes_and_goes_on_braking, driving),
        cmocka_unit_test_setup(nobody_without_a_session_opens_the_motors, fresh),
        cmocka_unit_test_setup(a_robot_stands_when_ready_or_still_in_a_fault, fresh),
        cmocka_unit_test_setup(what_the_watch_finds_is_latched_under_its_own_name, driving),
        cmocka_unit_test_setup(a_wheel_that_still_runs_away_cannot_be_cleared, driving),
        cmocka_unit_test_setup(a_tick_that_comes_much_too_late_is_an_overrun, driving),
        cmocka_unit_test_setup(the_first_tick_may_come_when_it_likes, fresh),
        cmocka_unit_test_setup(a_start_after_the_watchdog_is_a_fault_until_cleared, fresh),
        cmocka_unit_test_setup(no_other_reset_is_a_fault, fresh),
        cmocka_unit_test_setup(clear_leads_to_ready_once_the_wheels_stand_and_to_stopped_before, driving),
        cmocka_unit_test(a_battery_that_is_no_longer_watched_is_no_longer_low),
        cmocka_unit_test(a_session_that_opens_while_the_wheels_turn_is_ready_only_when_they_stand),
        cmocka_unit_test_setup(stop_ends_driving_at_once_and_is_ready_when_the_wheels_stand, driving),
        cmocka_unit_test_setup(a_stopping_robot_may_be_driven_on, driving),
        cmocka_unit_test_setup(stop_neither_clears_a_fault_nor_opens_a_session, link_lost),
        cmocka_unit_test_setup(an_estop_is_honoured_in_every_state, fresh),
        cmocka_unit_test_setup(the_button_holds_the_fault_until_it_is_released_and_cleared, driving),
        cmocka_unit_test_setup(a_button_pressed_at_the_first_tick_wins_over_any_hurry, fresh),
        cmocka_unit_test_setup(clear_needs_the_nonce_of_this_start, link_lost),
        cmocka_unit_test_setup(clear_where_nothing_is_wrong_changes_nothing, driving),
        cmocka_unit_test_setup(clearing_a_fault_without_a_session_leads_back_to_boot, fresh),
        cmocka_unit_test_setup(a_session_opened_during_a_fault_counts_once_it_is_cleared, fresh),
        cmocka_unit_test_setup(a_short_sag_is_no_fault_and_half_a_second_is, driving),
        cmocka_unit_test_setup(a_low_battery_is_cleared_only_when_it_has_clearly_recovered, driving),
        cmocka_unit_test_setup(clearing_another_fault_with_a_low_battery_shows_the_battery, link_lost),
        cmocka_unit_test_setup(a_battery_that_is_not_measured_or_not_watched_is_never_low, driving),
    };
    return cmocka_run_group_tests_name("supervisor", tests, NULL, NULL);
}
