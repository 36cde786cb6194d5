// Specification of watch.c, on a robot that rolls: what is noticed how soon, and that nothing else is.
//
// WATCH_HOURS=100 in the environment drives about for longer than the two hours of the test.
#include <setjmp.h> // cmocka
#include <stdarg.h> // cmocka
#include <stddef.h> // cmocka
#include <stdint.h> // cmocka

#include <cmocka.h> // the test framework
#include <math.h>   // fabs, fmax
#include <stdio.h>  // printf
#include <stdlib.h> // getenv, atof

#include "rolling_robot.h" // a robot to watch
#include "watch.h"         // what is specified here

#define PLANTS 60

static struct rolling rolling;

// --- Robots that differ ----------------------------------------------------------------------------

static uint64_t chance;

static double between(double low, double high)
{
    chance ^= chance << 13;
    chance ^= chance >> 7;
    chance ^= chance << 17;
    return low + (high - low) * (double)(chance >> 11) / 9007199254740992.0;
}

static int pick(int count)
{
    return (int)between(0, count);
}

// Motors 15 % better or worse, quick or slow, stiff or not; batteries full and empty; encoders with uneven
// edges.
static void some_robot(int which)
{
    chance = UINT64_C(0x9E3779B97F4A7C15) * (uint64_t)(which + 1);
    for (int i = 0; i < 10; i++)
        between(0, 1);
    rolling_init(&rolling);
    rolling.battery_v = between(6.9, 8.4);
    rolling.sag_v = between(0.1, 0.4);
    for (int side = 0; side < DRIVE_SIDES; side++) {
        struct rolling_wheel *wheel = &rolling.wheels[side];
        wheel->full_mm_s = 760 * between(0.85, 1.15);
        wheel->lag_s = between(0.03, 0.09);
        wheel->friction = between(0.05, 0.15);
        wheel->mm = between(1.1, 3.9);
        for (int edge = 1; edge < 4; edge++)
            wheel->uneven[edge] = between(-0.2, 0.2);
    }
    rolling_hello(&rolling);
    rolling_ms(&rolling, 50);
}

static uint8_t fault(void)
{
    return rolling.robot.supervisor.fault;
}

// Drive until something is noticed; how long that took, 5000 when it was not.
static unsigned ms_until_fault(int v_mm_s, int omega_mrad_s)
{
    unsigned ms = 0;
    while (fault() == FAULT_NONE && ms < 5000) {
        if (ms % 50 == 0)
            rolling_drive(&rolling, v_mm_s, omega_mrad_s);
        rolling_tick(&rolling);
        ms += 5;
    }
    return ms;
}

static void drive_a_while(int v_mm_s, int omega_mrad_s)
{
    rolling_drive_ms(&rolling, 1500 + 5 * (unsigned)pick(40), v_mm_s, omega_mrad_s);
    assert_int_equal(fault(), FAULT_NONE);
}

static double way_mm(int side, double from_mm)
{
    return fabs(rolling.wheels[side].mm - from_mm);
}

// --- Dead encoders ---------------------------------------------------------------------------------

// The longest that it takes in any robot, either wheel, either way.
static unsigned longest_ms(int v_mm_s, bool from_start, bool channel_a, bool channel_b)
{
    unsigned longest = 0;
    for (int which = 0; which < PLANTS; which++) {
        some_robot(which);
        int v = which & 2 ? -v_mm_s : v_mm_s;
        if (!from_start)
            drive_a_while(v, 0);
        rolling.wheels[which & 1].dead[0] = channel_a;
        rolling.wheels[which & 1].dead[1] = channel_b;
        unsigned ms = ms_until_fault(v, 0);
        assert_int_equal(fault(), FAULT_ENCODER_DEAD);
        assert_int_equal(rolling.hal.duty[which & 1], 0); // in the same tick
        longest = ms > longest ? ms : longest;
    }
    return longest;
}

static void an_encoder_that_falls_silent_on_the_way_is_missed_within_150_ms(void **state)
{
    (void)state;
    for (int v = 100; v <= 400; v += 50) {
        unsigned ms = longest_ms(v, false, true, true);
        printf("encoder dead at %d mm/s: %u ms\n", v, ms);
        assert_true(ms <= 150);
    }
}

static void so_is_one_that_loses_a_channel_and_counts_to_and_fro(void **state)
{
    (void)state;
    for (int v = 150; v <= 400; v += 50) {
        unsigned a = longest_ms(v, false, true, false), b = longest_ms(v, false, false, true);
        printf("channel dead at %d mm/s: %u and %u ms\n", v, a, b);
        assert_true(a <= 150 && b <= 150);
    }
}

static void at_10_cm_s_a_lost_channel_takes_one_count_longer(void **state)
{
    (void)state;
    unsigned a = longest_ms(100, false, true, false), b = longest_ms(100, false, false, true);
    printf("channel dead at 100 mm/s: %u and %u ms\n", a, b);
    assert_true(a <= 200 && b <= 200);
}

// A healthy wheel's first count comes 0.14 to 0.22 s after the command.
static void an_encoder_dead_from_the_start_is_missed_soon_after_its_first_count_was_due(void **state)
{
    (void)state;
    for (int v = 200; v <= 400; v += 50) {
        unsigned ms = longest_ms(v, true, true, true);
        printf("encoder dead from the start, %d mm/s: %u ms after the command\n", v, ms);
        assert_true(ms <= 400);
    }
    unsigned slow_ms = longest_ms(100, true, true, true);
    printf("encoder dead from the start, 100 mm/s: %u ms after the command\n", slow_ms);
}

static void a_slow_wheel_is_missed_too(void **state)
{
    (void)state;
    for (int v = 30; v <= 70; v += 20) {
        unsigned ms = longest_ms(v, false, true, true);
        printf("encoder dead at %d mm/s: %u ms\n", v, ms);
        assert_true(ms < 5000);
    }
}

static void a_wheel_that_turns_while_the_other_is_told_to_stand_is_missed_too(void **state)
{
    (void)state;
    for (int which = 0; which < PLANTS; which++) {
        some_robot(which);
        drive_a_while(100, 1333); // the right wheel stands
        rolling.wheels[DRIVE_LEFT].dead[0] = rolling.wheels[DRIVE_LEFT].dead[1] = true;
        assert_true(ms_until_fault(100, 1333) <= 150);
        assert_int_equal(fault(), FAULT_ENCODER_DEAD);
    }
}

// --- Stalls ----------------------------------------------------------------------------------------

static void both_wheels_blocked_on_the_way_are_a_stall_within_500_ms(void **state)
{
    (void)state;
    unsigned longest = 0;
    for (int v = 100; v <= 500; v += 100) {
        for (int which = 0; which < PLANTS; which++) {
            some_robot(which);
            drive_a_while(v, 0);
            rolling.wheels[DRIVE_LEFT].blocked = rolling.wheels[DRIVE_RIGHT].blocked = true;
            unsigned ms = ms_until_fault(v, 0);
            assert_int_equal(fault(), FAULT_STALL);
            longest = ms > longest ? ms : longest;
        }
    }
    printf("stall on the way: %u ms\n", longest);
    assert_true(longest <= 500);
}

static void both_wheels_blocked_from_the_start_are_a_stall_within_500_ms(void **state)
{
    (void)state;
    unsigned longest = 0;
    for (int v = 100; v <= 500; v += 100) {
        for (int which = 0; which < PLANTS; which++) {
            some_robot(which);
            rolling.wheels[DRIVE_LEFT].blocked = rolling.wheels[DRIVE_RIGHT].blocked = true;
            unsigned ms = ms_until_fault(v, 0);
            assert_int_equal(fault(), FAULT_STALL);
            longest = ms > longest ? ms : longest;
        }
    }
    printf("stall from the start: %u ms\n", longest);
    assert_true(longest <= 500);
}

static void both_encoders_unplugged_look_like_a_stall_and_drive_blind_for_no_longer(void **state)
{
    (void)state;
    double blind_mm = 0;
    for (int which = 0; which < PLANTS; which++) {
        some_robot(which);
        drive_a_while(400, 0);
        for (int side = 0; side < DRIVE_SIDES; side++)
            rolling.wheels[side].dead[0] = rolling.wheels[side].dead[1] = true;
        double from_mm = rolling.wheels[DRIVE_LEFT].mm;
        assert_true(ms_until_fault(400, 0) <= 500);
        assert_int_equal(fault(), FAULT_STALL);
        blind_mm = fmax(blind_mm, way_mm(DRIVE_LEFT, from_mm));
    }
    printf("both encoders unplugged at 400 mm/s: %.0f mm driven blind\n", blind_mm);
}

// --- Wrong signs -----------------------------------------------------------------------------------

static double furthest_mm;

static void expect_reversed_within_5_cm(int v_mm_s, int omega_mrad_s)
{
    double from_mm[DRIVE_SIDES] = {rolling.wheels[DRIVE_LEFT].mm, rolling.wheels[DRIVE_RIGHT].mm};
    assert_true(ms_until_fault(v_mm_s, omega_mrad_s) < 5000);
    assert_int_equal(fault(), FAULT_ENCODER_REVERSED);
    for (int side = 0; side < DRIVE_SIDES; side++) {
        if (rolling.swapped || rolling.wheels[side].reversed) {
            assert_true(way_mm(side, from_mm[side]) < 50);
            furthest_mm = fmax(furthest_mm, way_mm(side, from_mm[side]));
        }
    }
}

static void a_reversed_encoder_is_noticed_before_5_cm(void **state)
{
    (void)state;
    for (int v = 30; v <= 600; v += 95) {
        for (int which = 0; which < PLANTS; which++) {
            some_robot(which);
            rolling.wheels[which & 1].reversed = true;
            expect_reversed_within_5_cm(which & 2 ? -v : v, 0);
        }
    }
}

static void both_encoders_reversed_are_noticed_before_5_cm(void **state)
{
    (void)state;
    for (int v = 30; v <= 600; v += 95) {
        for (int which = 0; which < PLANTS; which++) {
            some_robot(which);
            rolling.wheels[DRIVE_LEFT].reversed = rolling.wheels[DRIVE_RIGHT].reversed = true;
            expect_reversed_within_5_cm(which & 2 ? -v : v, 0);
        }
    }
}

static void swapped_encoders_are_noticed_on_the_first_turn_before_5_cm(void **state)
{
    (void)state;
    for (int omega = 400; omega <= 6000; omega += 800) {
        for (int which = 0; which < PLANTS; which++) {
            some_robot(which);
            rolling.swapped = true;
            expect_reversed_within_5_cm(0, which & 2 ? -omega : omega);
        }
    }
    printf("wrong signs: at most %.0f mm\n", furthest_mm);
}

static void swapped_encoders_do_not_stay_unnoticed_in_a_curve(void **state)
{
    (void)state;
    for (int v = 100; v <= 300; v += 100) {
        for (int which = 0; which < PLANTS; which++) {
            some_robot(which);
            rolling.swapped = true;
            assert_true(ms_until_fault(v, which & 2 ? -1000 : 1000) < 5000);
        }
    }
}

// --- Running away ----------------------------------------------------------------------------------

static void a_motor_whose_driver_is_shorted_is_noticed(void **state)
{
    (void)state;
    unsigned longest = 0;
    for (int v = 50; v <= 300; v += 50) {
        for (int which = 0; which < PLANTS; which++) {
            some_robot(which);
            drive_a_while(v, 0);
            rolling.wheels[which & 1].stuck = true;
            rolling.wheels[which & 1].stuck_duty = 1;
            unsigned ms = ms_until_fault(v, 0);
            assert_int_equal(fault(), FAULT_RUNAWAY);
            longest = ms > longest ? ms : longest;
        }
    }
    printf("driver shorted, driving: %u ms\n", longest);
}

static void a_motor_that_goes_on_after_stop_is_noticed_and_cannot_be_cleared(void **state)
{
    (void)state;
    unsigned longest = 0;
    for (int v = 30; v <= 600; v += 95) {
        for (int which = 0; which < PLANTS; which++) {
            some_robot(which);
            drive_a_while(v, 0);
            rolling.wheels[which & 1].stuck = true;
            rolling.wheels[which & 1].stuck_duty = 1;
            rolling_stop(&rolling, STOP_BRAKE);
            unsigned ms = 0;
            while (fault() == FAULT_NONE && ms < 5000) {
                rolling_tick(&rolling);
                ms += 5;
            }
            longest = ms > longest ? ms : longest;
            assert_int_equal(fault(), FAULT_RUNAWAY);
            rolling_clear(&rolling);
            assert_int_equal(fault(), FAULT_RUNAWAY);
        }
    }
    printf("driver shorted, after STOP: %u ms\n", longest);
    rolling.wheels[0].stuck = rolling.wheels[1].stuck = false;
    rolling_ms(&rolling, 1000);
    rolling_clear(&rolling);
    assert_int_equal(fault(), FAULT_NONE);
}

// --- Nothing wrong ---------------------------------------------------------------------------------

static double aim_drag[DRIVE_SIDES], aim_slope; // where carpets and slopes are going

static void expect_nothing_wrong(int which, const char *act)
{
    if (fault() != FAULT_NONE)
        fail_msg("robot %d, %.3f s, %s: fault %u", which, rolling.now_us * 1e-6, act, fault());
}

static void tick(void)
{
    for (int side = 0; side < DRIVE_SIDES; side++) {
        struct rolling_wheel *wheel = &rolling.wheels[side];
        wheel->drag += (aim_drag[side] - wheel->drag) * 0.03;
        wheel->slope += (aim_slope - wheel->slope) * 0.03;
    }
    rolling_tick(&rolling);
}

static void drive_on(double ms, double v_mm_s, double omega_mrad_s)
{
    for (unsigned done = 0; done < ms; done += 5) {
        if (done % 50 == 0)
            rolling_drive(&rolling, (int)v_mm_s, (int)omega_mrad_s);
        tick();
    }
}

static void wait(double ms)
{
    for (unsigned done = 0; done < ms; done += 5)
        tick();
}

static void push_by_hand(void)
{
    rolling_stop(&rolling, pick(2) ? STOP_COAST : STOP_BRAKE);
    wait(1500);
    for (int pushes = 1 + pick(4); pushes > 0; pushes--) {
        for (int side = 0; side < DRIVE_SIDES; side++) {
            rolling.wheels[side].pushed = pick(4) > 0;
            rolling.wheels[side].push_mm_s = between(-600, 600);
        }
        wait(between(50, 1000));
        rolling.wheels[DRIVE_LEFT].pushed = rolling.wheels[DRIVE_RIGHT].pushed = false;
        wait(between(50, 1000));
    }
}

static void make_a_move(void)
{
    rolling_stop(&rolling, STOP_BRAKE);
    wait(2000);
    if (pick(2))
        rolling_move(&rolling, (int)between(-1500, 1500), (unsigned)between(30, 600));
    else
        rolling_turn(&rolling, (int)between(-6000, 6000), (unsigned)between(200, 4000));
    for (int ticks = 0; ticks < 4000 && rolling.robot.supervisor.state == STATE_MOVING; ticks++) {
        if (ticks % 10 == 0)
            rolling_keep_alive(&rolling);
        tick();
    }
}

static const char *act_at_random(void)
{
    double v = between(100, 600), omega = between(-3000, 3000);
    aim_drag[DRIVE_LEFT] = aim_drag[DRIVE_RIGHT] = 0;
    aim_slope = pick(4) == 0 ? between(-0.04, 0.04) : 0;
    for (int side = 0, carpet = pick(4) == 0; carpet && side < DRIVE_SIDES; side++)
        aim_drag[side] = between(0, 0.04);
    switch (pick(11)) {
    case 0: drive_on(between(500, 5000), between(-80, 80), between(-100, 100)); return "slow";
    case 1: drive_on(between(50, 3000), between(-600, 600), 0); return "straight";
    case 2: drive_on(between(100, 2000), 0, between(-4000, 4000)); return "spin";
    case 3: drive_on(between(100, 2000), fabs(omega) * 0.075, omega); return "one wheel stands";
    case 4: rolling_stop(&rolling, STOP_BRAKE); wait(between(5, 1500)); return "brake";
    case 5: rolling_stop(&rolling, STOP_COAST); wait(between(5, 2500)); return "coast";
    case 6: push_by_hand(); return "push";
    case 7:
        for (int flips = 0; flips < 6; flips++, v = -v)
            drive_on(50 * (1 + pick(12)), v, between(-500, 500));
        return "to and fro";
    case 8: make_a_move(); return "move";
    default: drive_on(between(50, 3000), between(-500, 500), between(-2000, 2000)); return "drive";
    }
}

static void driving_about_for_hours_is_no_fault(void **state)
{
    (void)state;
    const char *told = getenv("WATCH_HOURS");
    double hours = 0, enough = told ? atof(told) : 2;
    for (int which = 0; hours < enough; which++) {
        some_robot(which);
        while (rolling.now_us < 180000000u) {
            const char *act = act_at_random();
            expect_nothing_wrong(which, act);
        }
        hours += rolling.now_us / 3.6e9;
    }
    printf("no false fault in %.1f hours\n", hours);
}

static void a_circle_driven_all_day_is_no_fault(void **state)
{
    (void)state;
    some_robot(1);
    rolling_drive_ms(&rolling, 300000, 500, 1000);
    assert_int_equal(fault(), FAULT_NONE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_encoder_that_falls_silent_on_the_way_is_missed_within_150_ms),
        cmocka_unit_test(so_is_one_that_loses_a_channel_and_counts_to_and_fro),
        cmocka_unit_test(at_10_cm_s_a_lost_channel_takes_one_count_longer),
        cmocka_unit_test(an_encoder_dead_from_the_start_is_missed_soon_after_its_first_count_was_due),
        cmocka_unit_test(a_slow_wheel_is_missed_too),
        cmocka_unit_test(a_wheel_that_turns_while_the_other_is_told_to_stand_is_missed_too),
        cmocka_unit_test(both_wheels_blocked_on_the_way_are_a_stall_within_500_ms),
        cmocka_unit_test(both_wheels_blocked_from_the_start_are_a_stall_within_500_ms),
        cmocka_unit_test(both_encoders_unplugged_look_like_a_stall_and_drive_blind_for_no_longer),
        cmocka_unit_test(a_reversed_encoder_is_noticed_before_5_cm),
        cmocka_unit_test(both_encoders_reversed_are_noticed_before_5_cm),
        cmocka_unit_test(swapped_encoders_are_noticed_on_the_first_turn_before_5_cm),
        cmocka_unit_test(swapped_encoders_do_not_stay_unnoticed_in_a_curve),
        cmocka_unit_test(a_motor_whose_driver_is_shorted_is_noticed),
        cmocka_unit_test(a_motor_that_goes_on_after_stop_is_noticed_and_cannot_be_cleared),
        cmocka_unit_test(driving_about_for_hours_is_no_fault),
        cmocka_unit_test(a_circle_driven_all_day_is_no_fault),
    };
    return cmocka_run_group_tests_name("watch", tests, NULL, NULL);
}
