// Specification of move.c: which way the wheels go, how fast, how they keep level, and when a move is at its
// end.
#include <setjmp.h> // cmocka
#include <stdarg.h> // cmocka
#include <stddef.h> // cmocka
#include <stdint.h> // cmocka

#include <cmocka.h>  // the test framework
#include <stdbool.h> // bool
#include <stdlib.h>  // abs
#include <string.h>  // memset

#include "move.h" // what is specified here

// --- Two wheels that turn as they are told, 60 ms later --------------------------------------------

static const struct drive_limits limits = {.track_um = 150000, .speed_q4 = 8000, .step_q4 = 80};

static struct {
    struct move move;
    double at_um[DRIVE_SIDES];
    double speed_mm_s[DRIVE_SIDES];
    double gain[DRIVE_SIDES]; // share of what it is told that a wheel does
    int16_t setpoint_q4[DRIVE_SIDES];
    int fastest_q4[DRIVE_SIDES];
    int steepest_q4; // change of a setpoint in a tick, away from zero
} rig;

static int fresh(void **state)
{
    (void)state;
    memset(&rig, 0, sizeof rig);
    rig.gain[0] = rig.gain[1] = 1;
    return 0;
}

static int32_t at_um(int side)
{
    return (int32_t)rig.at_um[side];
}

static bool tick(void)
{
    int16_t before[DRIVE_SIDES] = {rig.setpoint_q4[0], rig.setpoint_q4[1]};
    bool done = move_update(&rig.move, at_um(DRIVE_LEFT), at_um(DRIVE_RIGHT), rig.setpoint_q4);
    for (int side = 0; side < DRIVE_SIDES; side++) {
        int told = rig.setpoint_q4[side];
        if (abs(told) - abs(before[side]) > rig.steepest_q4)
            rig.steepest_q4 = abs(told) - abs(before[side]);
        if (abs(told) > rig.fastest_q4[side])
            rig.fastest_q4[side] = abs(told);
        rig.speed_mm_s[side] += (told / 16.0 * rig.gain[side] - rig.speed_mm_s[side]) / 12;
        rig.at_um[side] += rig.speed_mm_s[side] * 5;
    }
    return done;
}

// To the end; how many ticks that took.
static int run(void)
{
    for (int ticks = 1; ticks < 100000; ticks++)
        if (tick())
            return ticks;
    fail_msg("a move without an end");
    return 0;
}

static void expect_near(int32_t value, int32_t wanted, int32_t tolerance)
{
    assert_in_range(value + 1000000000, wanted - tolerance + 1000000000, wanted + tolerance + 1000000000);
}

static void straight(int16_t distance_mm, uint16_t speed_mm_s)
{
    move_begin_straight(&rig.move, &limits, distance_mm, speed_mm_s, at_um(0), at_um(1));
}

// --- Where it ends ---------------------------------------------------------------------------------

static void a_straight_move_takes_both_wheels_as_far_wherever_they_began(void **state)
{
    const int16_t distances_mm[] = {1000, -1000, 300, 20, -20, 5};
    for (int i = 0; i < 6; i++) {
        fresh(state);
        rig.at_um[0] = 1000;
        rig.at_um[1] = -7000;
        straight(distances_mm[i], 200);
        run();
        expect_near(at_um(0), 1000 + distances_mm[i] * 1000, 700);
        expect_near(at_um(1), -7000 + distances_mm[i] * 1000, 700);
        assert_int_equal(rig.setpoint_q4[0], 0);
        assert_int_equal(rig.setpoint_q4[1], 0);
    }
}

static void a_turn_to_the_right_takes_the_left_wheel_forward_and_the_right_one_back(void **state)
{
    const int16_t angles_mrad[] = {1571, -1571, 87, -6283};
    for (int i = 0; i < 4; i++) {
        fresh(state);
        move_begin_turn(&rig.move, &limits, angles_mrad[i], 2000, 0, 0);
        run();
        expect_near(at_um(0), angles_mrad[i] * 75, 700);
        expect_near(at_um(1), -angles_mrad[i] * 75, 700);
    }
}

static void a_move_of_nothing_ends_without_turning_a_wheel(void **state)
{
    (void)state;
    straight(0, 200);
    run();
    assert_int_equal(at_um(0), 0);
    move_begin_turn(&rig.move, &limits, 0, 2000, 0, 0);
    run();
    assert_int_equal(at_um(1), 0);
}

static void the_end_is_when_the_wheels_have_stood_for_a_tenth_of_a_second(void **state)
{
    (void)state;
    straight(100, 200);
    int32_t before = 0;
    int still = 0;
    while (!tick()) {
        still = at_um(0) == before ? still + 1 : 0;
        before = at_um(0);
    }
    assert_int_equal(still, 20);
}

static void one_wheel_that_still_rolls_keeps_the_move_from_its_end(void **state)
{
    (void)state;
    straight(0, 200);
    for (int i = 0; i < 200; i++) {
        rig.at_um[1] += 1;
        assert_false(tick());
    }
    run();
}

static void extremes_do_not_overflow(void **state)
{
    const struct drive_limits wide = {.track_um = 1000000, .speed_q4 = INT16_MAX, .step_q4 = INT16_MAX};
    const int16_t amounts[] = {INT16_MIN, INT16_MAX};
    for (int i = 0; i < 2; i++) {
        fresh(state);
        move_begin_straight(&rig.move, &wide, amounts[i], UINT16_MAX, 0, 0);
        run();
        expect_near(at_um(0), amounts[i] * 1000, 20000);
        fresh(state);
        move_begin_turn(&rig.move, &wide, amounts[i], UINT16_MAX, 0, 0);
        run();
        expect_near(at_um(0), amounts[i] * 500, 20000);
    }
}

static void travel_may_wrap_on_the_way(void **state)
{
    (void)state;
    move_begin_straight(&rig.move, &limits, 1000, 200, INT32_MAX - 1000, INT32_MIN);
    move_update(&rig.move, INT32_MIN + 999000, INT32_MIN + 1000000, rig.setpoint_q4);
    assert_true(rig.move.arrived[0]);
    assert_true(rig.move.arrived[1]);
}

// --- How fast --------------------------------------------------------------------------------------

static void it_goes_as_fast_as_asked_and_no_faster(void **state)
{
    (void)state;
    straight(1000, 300);
    run();
    assert_int_equal(rig.fastest_q4[0], 300 * 16);
    assert_int_equal(rig.fastest_q4[1], 300 * 16);
}

static void speed_and_rate_are_cut_to_what_a_wheel_may_do(void **state)
{
    const uint16_t speeds[] = {501, 10000, UINT16_MAX};
    for (int i = 0; i < 3; i++) {
        fresh(state);
        straight(5000, speeds[i]);
        run();
        assert_int_equal(rig.fastest_q4[0], limits.speed_q4);
        fresh(state);
        move_begin_turn(&rig.move, &limits, 20000, speeds[i] < 7000 ? 7000 : speeds[i], 0, 0);
        run();
        assert_int_equal(rig.fastest_q4[0], limits.speed_q4);
    }
}

static void a_turn_at_a_rate_turns_its_wheels_at_half_the_track_times_it(void **state)
{
    (void)state;
    move_begin_turn(&rig.move, &limits, 6283, 2000, 0, 0);
    run();
    assert_int_equal(rig.fastest_q4[0], 2 * 75 * 16);
}

static void the_ramp_is_never_exceeded(void **state)
{
    const int16_t distances_mm[] = {1000, 100, 10};
    for (int i = 0; i < 3; i++) {
        fresh(state);
        straight(distances_mm[i], 500);
        run();
        assert_int_equal(rig.steepest_q4, limits.step_q4);
    }
}

static void a_short_move_turns_back_down_before_its_full_speed(void **state)
{
    (void)state;
    straight(60, 500);
    run();
    assert_true(rig.fastest_q4[0] < 300 * 16);
    expect_near(at_um(0), 60000, 700);
}

static void a_move_slower_than_its_creeping_keeps_its_speed(void **state)
{
    (void)state;
    straight(10, 1);
    assert_true(run() > 9 * 200);
    assert_int_equal(rig.fastest_q4[0], 16);
    fresh(state);
    move_begin_turn(&rig.move, &limits, 50, 1, 0, 0); // 1.2 sixteenths of mm/s
    run();
    assert_int_equal(rig.fastest_q4[0], 1);
    fresh(state);
    const struct drive_limits narrow = {.track_um = 20000, .speed_q4 = 8000, .step_q4 = 80};
    move_begin_turn(&rig.move, &narrow, 50, 1, 0, 0); // 0.16 of them
    run();
    assert_int_equal(rig.fastest_q4[0], 1);
}

// --- Level -----------------------------------------------------------------------------------------

static void wheels_that_do_not_turn_alike_are_kept_level(void **state)
{
    for (int turn = 0; turn < 2; turn++) {
        fresh(state);
        rig.gain[0] = 1.15;
        rig.gain[1] = 0.85;
        if (turn)
            move_begin_turn(&rig.move, &limits, 6283, 3000, 0, 0);
        else
            straight(1000, 300);
        int32_t worst = 0;
        while (!tick()) {
            int32_t apart = abs(at_um(0)) - abs(at_um(1));
            worst = abs(apart) > worst ? abs(apart) : worst;
        }
        assert_in_range(worst, 1000, 24000); // a lead that makes up for 30 % of 300 mm/s
        expect_near(abs(at_um(0)), abs(at_um(1)), 1200);
    }
}

static void a_wheel_far_behind_slows_the_other_to_half_and_no_further(void **state)
{
    for (int behind = 0; behind < 2; behind++) {
        fresh(state);
        straight(1000, 200);
        for (int i = 0; i < 100; i++)
            tick();
        rig.gain[behind] = 0;
        for (int i = 0; i < 200; i++)
            tick();
        assert_int_equal(rig.setpoint_q4[1 - behind], 1600);
        assert_int_equal(rig.setpoint_q4[behind], 4800);
    }
}

static void the_wheel_that_is_there_first_waits_for_the_other(void **state)
{
    (void)state;
    straight(100, 200);
    for (int i = 0; i < 60; i++)
        tick();
    rig.at_um[0] += 80000; // over the end, by a slip
    tick();
    assert_int_equal(rig.setpoint_q4[0], 0);
    assert_true(rig.setpoint_q4[1] > 0);
    run();
    expect_near(at_um(1), 100000, 2000);
}

// --- Pause -----------------------------------------------------------------------------------------

static void after_a_pause_the_ramp_begins_anew_and_the_end_stays(void **state)
{
    (void)state;
    straight(500, 400);
    for (int i = 0; i < 100; i++)
        tick();
    move_pause(&rig.move);
    rig.setpoint_q4[0] = rig.setpoint_q4[1] = 0;
    rig.speed_mm_s[0] = rig.speed_mm_s[1] = 0;
    rig.steepest_q4 = 0;
    tick();
    assert_true(rig.setpoint_q4[0] <= 2 * limits.step_q4);
    run();
    expect_near(at_um(0), 500000, 700);
    expect_near(at_um(1), 500000, 700);
}

static void a_pause_at_the_end_lets_the_standing_begin_anew(void **state)
{
    (void)state;
    straight(0, 400);
    for (int i = 0; i < 10; i++)
        tick();
    move_pause(&rig.move);
    assert_int_equal(run(), 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_straight_move_takes_both_wheels_as_far_wherever_they_began, fresh),
        cmocka_unit_test_setup(a_turn_to_the_right_takes_the_left_wheel_forward_and_the_right_one_back, fresh),
        cmocka_unit_test_setup(a_move_of_nothing_ends_without_turning_a_wheel, fresh),
        cmocka_unit_test_setup(the_end_is_when_the_wheels_have_stood_for_a_tenth_of_a_second, fresh),
        cmocka_unit_test_setup(one_wheel_that_still_rolls_keeps_the_move_from_its_end, fresh),
        cmocka_unit_test_setup(extremes_do_not_overflow, fresh),
        cmocka_unit_test_setup(travel_may_wrap_on_the_way, fresh),
        cmocka_unit_test_setup(it_goes_as_fast_as_asked_and_no_faster, fresh),
        cmocka_unit_test_setup(speed_and_rate_are_cut_to_what_a_wheel_may_do, fresh),
        cmocka_unit_test_setup(a_turn_at_a_rate_turns_its_wheels_at_half_the_track_times_it, fresh),
        cmocka_unit_test_setup(the_ramp_is_never_exceeded, fresh),
        cmocka_unit_test_setup(a_short_move_turns_back_down_before_its_full_speed, fresh),
        cmocka_unit_test_setup(a_move_slower_than_its_creeping_keeps_its_speed, fresh),
        cmocka_unit_test_setup(wheels_that_do_not_turn_alike_are_kept_level, fresh),
        cmocka_unit_test_setup(a_wheel_far_behind_slows_the_other_to_half_and_no_further, fresh),
        cmocka_unit_test_setup(the_wheel_that_is_there_first_waits_for_the_other, fresh),
        cmocka_unit_test_setup(after_a_pause_the_ramp_begins_anew_and_the_end_stays, fresh),
        cmocka_unit_test_setup(a_pause_at_the_end_lets_the_standing_begin_anew, fresh),
    };
    return cmocka_run_group_tests_name("move", tests, NULL, NULL);
}
