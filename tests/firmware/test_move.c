// Specification of move.c: which way the wheels go, how fast, and when a move is at its end.
#include <setjmp.h> // cmocka
#include <stdarg.h> // cmocka
#include <stddef.h> // cmocka
#include <stdint.h> // cmocka

#include <cmocka.h> // the test framework
#include <stdlib.h> // abs

#include "move.h" // what is specified here

static const struct drive_limits limits = {.track_um = 150000, .speed_q4 = 8000, .step_q4 = 80};

static struct move move;
static int16_t setpoint_q4[DRIVE_SIDES];
static int32_t at_16um[DRIVE_SIDES]; // sixteenths of micrometres

// Wheels that turn exactly as they are told. Ticks until the end.
static int run(void)
{
    for (int tick = 1; tick < 20000; tick++) {
        if (move_update(&move, at_16um[0] / 16, at_16um[1] / 16, setpoint_q4))
            return tick;
        for (int side = 0; side < DRIVE_SIDES; side++)
            at_16um[side] += setpoint_q4[side] * 5; // mm/s / 16 for 5 ms
    }
    fail_msg("a move without an end");
    return 0;
}

static void a_straight_move_takes_both_wheels_the_same_way(void **state)
{
    (void)state;
    at_16um[0] = 1000 * 16;
    at_16um[1] = -7000 * 16;
    move_begin_straight(&move, &limits, 300, 200, 1000, -7000);
    run();
    assert_true(abs(at_16um[0] / 16 - 301000) < 2000);
    assert_true(abs(at_16um[1] / 16 - 293000) < 2000);
}

static void a_turn_to_the_right_takes_the_left_wheel_forward_and_the_right_one_back(void **state)
{
    (void)state;
    at_16um[0] = at_16um[1] = 0;
    move_begin_turn(&move, &limits, 1571, 1500, 0, 0);
    run();
    assert_true(abs(at_16um[0] / 16 - 117825) < 2000);
    assert_true(abs(at_16um[1] / 16 + 117825) < 2000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_straight_move_takes_both_wheels_the_same_way),
        cmocka_unit_test(a_turn_to_the_right_takes_the_left_wheel_forward_and_the_right_one_back),
    };
    return cmocka_run_group_tests_name("move", tests, NULL, NULL);
}
