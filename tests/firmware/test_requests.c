// Specification of requests.c: what is new, what is repeated, what is too old, and whose outcome is told.
#include <setjmp.h> // cmocka
#include <stdarg.h> // cmocka
#include <stddef.h> // cmocka
#include <stdint.h> // cmocka

#include <cmocka.h> // the test framework

#include "requests.h" // what is specified here

static struct requests requests;

static int fresh(void **state)
{
    (void)state;
    requests = (struct requests){0};
    return 0;
}

static void expect(uint16_t last, uint8_t outcome, uint8_t reason)
{
    assert_int_equal(requests.last, last);
    assert_int_equal(requests.outcome, outcome);
    assert_int_equal(requests.reason, reason);
}

static void a_number_is_new_repeated_or_too_old_all_around_the_circle(void **state)
{
    (void)state;
    const uint16_t lasts[] = {0, 1, 0x7FFF, 0x8000, 0xFFFF};
    for (size_t i = 0; i < sizeof lasts / sizeof lasts[0]; i++) {
        requests.last = lasts[i];
        for (uint32_t ahead = 0; ahead < 0x10000; ahead++) {
            uint16_t number = (uint16_t)(lasts[i] + ahead);
            assert_int_equal(requests_repeats(&requests, number), ahead == 0);
            assert_int_equal(requests_refusal(&requests, number), ahead < 0x8000 ? 0 : REFUSED_OLD_REQUEST);
        }
    }
}

static void a_request_done_at_once_is_done(void **state)
{
    (void)state;
    assert_int_equal(requests_take(&requests, MSG_PARAM_WRITE, 7, 0, false), 0);
    expect(7, OUTCOME_DONE, REFUSED_NONE);
}

static void a_refused_request_is_taken_all_the_same(void **state)
{
    (void)state;
    assert_int_equal(requests_take(&requests, MSG_MOVE, 7, REFUSED_EXPIRED, true), REFUSED_EXPIRED);
    expect(7, OUTCOME_REFUSED, REFUSED_EXPIRED);
    requests_end(&requests, MSG_MOVE, OUTCOME_DONE, REFUSED_NONE);
    expect(7, OUTCOME_REFUSED, REFUSED_EXPIRED); // it never ran
}

static void what_runs_ends_once(void **state)
{
    (void)state;
    requests_take(&requests, MSG_MOVE, 7, 0, true);
    expect(7, OUTCOME_RUNNING, REFUSED_NONE);
    requests_end(&requests, MSG_PARAM_SAVE, OUTCOME_DONE, REFUSED_NONE); // something else
    expect(7, OUTCOME_RUNNING, REFUSED_NONE);
    requests_end(&requests, MSG_MOVE, OUTCOME_ABORTED, REFUSED_BY_STOP);
    expect(7, OUTCOME_ABORTED, REFUSED_BY_STOP);
    requests_end(&requests, MSG_MOVE, OUTCOME_DONE, REFUSED_NONE);
    expect(7, OUTCOME_ABORTED, REFUSED_BY_STOP);
}

static void while_one_runs_no_other_is_taken(void **state)
{
    (void)state;
    requests_take(&requests, MSG_MOVE, 7, 0, true);
    assert_int_equal(requests_refusal(&requests, 7), 0); // a repetition
    assert_int_equal(requests_refusal(&requests, 8), REFUSED_BUSY);
    assert_int_equal(requests_refusal(&requests, 6), REFUSED_OLD_REQUEST);
    expect(7, OUTCOME_RUNNING, REFUSED_NONE);
    requests_end(&requests, MSG_MOVE, OUTCOME_DONE, REFUSED_NONE);
    assert_int_equal(requests_refusal(&requests, 8), 0);
}

static void the_end_of_an_earlier_request_is_not_told_as_that_of_a_later_one(void **state)
{
    (void)state;
    requests_take(&requests, MSG_MOVE, 7, 0, true);
    requests_take(&requests, MSG_MOVE, 8, REFUSED_NOT_STANDING, true);
    requests_end(&requests, MSG_MOVE, OUTCOME_DONE, REFUSED_NONE);
    expect(8, OUTCOME_REFUSED, REFUSED_NOT_STANDING);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_number_is_new_repeated_or_too_old_all_around_the_circle, fresh),
        cmocka_unit_test_setup(a_request_done_at_once_is_done, fresh),
        cmocka_unit_test_setup(a_refused_request_is_taken_all_the_same, fresh),
        cmocka_unit_test_setup(what_runs_ends_once, fresh),
        cmocka_unit_test_setup(while_one_runs_no_other_is_taken, fresh),
        cmocka_unit_test_setup(the_end_of_an_earlier_request_is_not_told_as_that_of_a_later_one, fresh),
    };
    return cmocka_run_group_tests_name("requests", tests, NULL, NULL);
}
