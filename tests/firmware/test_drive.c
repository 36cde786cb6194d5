// Specification of drive.c: who turns faster, what saturation keeps, and how the ramp runs.
#include <setjmp.h> // cmocka
#include <stdarg.h> // cmocka
#include <stddef.h> // cmocka
#include <stdint.h> // cmocka

#include <cmocka.h> // the test framework
#include <stdlib.h> // abs

#include "drive.h" // what is specified here

static const struct drive_limits limits = {.track_um = 150000, .speed_q4 = 8000, .step_q4 = 80};

static struct drive drive;

static int fresh(void **state)
{
    (void)state;
    drive_init(&drive, &limits);
    return 0;
}

static void expect_targets(int left_q4, int right_q4)
{
    assert_int_equal(drive.target_q4[DRIVE_LEFT], left_q4);
    assert_int_equal(drive.target_q4[DRIVE_RIGHT], right_q4);
}

static void a_new_drive_stands(void **state)
{
    (void)state;
    drive_update(&drive);
    expect_targets(0, 0);
    assert_int_equal(drive.setpoint_q4[DRIVE_LEFT], 0);
    assert_int_equal(drive.setpoint_q4[DRIVE_RIGHT], 0);
}

static void straight_ahead_turns_both_wheels_alike(void **state)
{
    (void)state;
    drive_command(&drive, 200, 0);
    expect_targets(3200, 3200);
    drive_command(&drive, -200, 0);
    expect_targets(-3200, -3200);
}

static void turning_right_makes_the_left_wheel_the_faster_one(void **state)
{
    (void)state;
    drive_command(&drive, 200, 1000); // 1 rad/s on half a track of 75 mm: 75 mm/s
    expect_targets(3200 + 1200, 3200 - 1200);
    drive_command(&drive, 0, -1000);
    expect_targets(-1200, 1200);
}

static void too_fast_a_command_keeps_its_curve(void **state)
{
    (void)state;
    drive_command(&drive, 1000, 4000); // 1300 and 700 mm/s, limit 500
    assert_int_equal(drive.target_q4[DRIVE_LEFT], 8000);
    assert_in_range(drive.target_q4[DRIVE_RIGHT], 8000 * 700 / 1300 - 2, 8000 * 700 / 1300 + 2);
    drive_command(&drive, -1000, 4000);
    assert_int_equal(drive.target_q4[DRIVE_RIGHT], -8000);
    assert_in_range(-drive.target_q4[DRIVE_LEFT], 8000 * 700 / 1300 - 2, 8000 * 700 / 1300 + 2);
}

static void no_command_overflows(void **state)
{
    (void)state;
    const int16_t extremes[] = {INT16_MIN, -1, 0, 1, INT16_MAX};
    struct drive_limits wide = {.track_um = 1000000, .speed_q4 = INT16_MAX, .step_q4 = INT16_MAX};
    drive_init(&drive, &wide);
    for (int v = 0; v < 5; v++) {
        for (int omega = 0; omega < 5; omega++) {
            drive_command(&drive, extremes[v], extremes[omega]);
            for (int tick = 0; tick < 4; tick++)
                drive_update(&drive);
            assert_int_equal(drive.setpoint_q4[DRIVE_LEFT], drive.target_q4[DRIVE_LEFT]);
            assert_int_equal(drive.setpoint_q4[DRIVE_RIGHT], drive.target_q4[DRIVE_RIGHT]);
        }
    }
    drive_command(&drive, INT16_MAX / 3, INT16_MAX);
    assert_int_equal(drive.target_q4[DRIVE_LEFT], INT16_MAX);
    assert_true(drive.target_q4[DRIVE_RIGHT] < 0); // on this track the turn outweighs the speed
}

static void the_ramp_moves_no_faster_than_its_step(void **state)
{
    (void)state;
    drive_command(&drive, 200, 0);
    for (int tick = 1; tick <= 40; tick++) {
        drive_update(&drive);
        assert_int_equal(drive.setpoint_q4[DRIVE_LEFT], 80 * tick);
    }
    drive_update(&drive);
    assert_int_equal(drive.setpoint_q4[DRIVE_LEFT], 3200);
}

static void both_wheels_arrive_together_so_a_slowing_robot_keeps_its_curve(void **state)
{
    (void)state;
    drive_command(&drive, 200, 1000);
    for (int tick = 0; tick < 1000; tick++)
        drive_update(&drive);
    drive_command(&drive, 0, 0);
    while (drive.setpoint_q4[DRIVE_LEFT] > 400) {
        drive_update(&drive);
        int expected = drive.setpoint_q4[DRIVE_LEFT] * 2000 / 4400;
        assert_true(abs(drive.setpoint_q4[DRIVE_RIGHT] - expected) < 16); // 1 mm/s
    }
}

static void release_stops_without_a_ramp(void **state)
{
    (void)state;
    drive_command(&drive, 400, 0);
    for (int tick = 0; tick < 50; tick++)
        drive_update(&drive);
    drive_release(&drive);
    drive_update(&drive);
    expect_targets(0, 0);
    assert_int_equal(drive.setpoint_q4[DRIVE_LEFT], 0);
    assert_int_equal(drive.setpoint_q4[DRIVE_RIGHT], 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_new_drive_stands, fresh),
        cmocka_unit_test_setup(straight_ahead_turns_both_wheels_alike, fresh),
        cmocka_unit_test_setup(turning_right_makes_the_left_wheel_the_faster_one, fresh),
        cmocka_unit_test_setup(too_fast_a_command_keeps_its_curve, fresh),
        cmocka_unit_test_setup(no_command_overflows, fresh),
        cmocka_unit_test_setup(the_ramp_moves_no_faster_than_its_step, fresh),
        cmocka_unit_test_setup(both_wheels_arrive_together_so_a_slowing_robot_keeps_its_curve, fresh),
        cmocka_unit_test_setup(release_stops_without_a_ramp, fresh),
    };
    return cmocka_run_group_tests_name("drive", tests, NULL, NULL);
}
