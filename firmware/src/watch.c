// What the wheels were told against what their encoders say. See watch.h.
#include "watch.h" // this file's manual

#include "messages.h" // enum fault

// A duty this far beyond what was measured to overcome friction overcomes carpet and slopes too, and a motor
// of the same kind that is stiffer.
#define SURE_MARGIN 4600 // 14 %

#define MM(mm) ((mm) * UINT32_C(3200)) // as a sum of q4 speeds over ticks
#define WAY_LEAST_UM 4000u // for less than 2.5 of these no wheel is missed: it takes its time to start
#define PACED_COUNTS 8u // a wheel that has come so far has found its pace
#define ORDINARY_Q4 (95 * 16) // friction may hold a slower wheel that was going on well
#define MISSED_TICKS 27u
#define RETREAT_TICKS 16u // of a wheel that has counted back, which a wheel at its pace does not
#define DEAD_ASKED MM(50) // besides two and a half counts
#define STALL_TICKS 80u
#define STALL_ASKED MM(26) // likewise
#define QUIET_TICKS 10u
#define TOLD_MOST MM(200)

#define REVERSED_UM 17500
#define ROLL_OUT_UM_PER_Q4 19 // a wheel told to turn back rolls on no further than at its speed in 0.3 s

// Faster than lately told by a quarter and 8 cm/s for 0.64 s, or by half and 20 cm/s for 0.04 s
#define FAST_MARGIN_Q4 (80 * 16)
#define FAR_MARGIN_Q4 (200 * 16)
#define FAR_WEIGHT 16u
#define FAST_MOST 128u
#define LATELY_SHIFT 6 // forgotten by half in 0.2 s
#define STANDING_Q4 (40 * 16)
#define STANDING_TICKS 20u

#define TURN_Q4 INT32_C(480) // less of a difference is no turn
#define TURN_TOLD MM(20)
#define TURN_UM 10000 // and two counts
#define UNLIKE_DIVISOR 8 // of both wheels' ways: they do not go alike
#define TURN_LONGEST_UM 10000000 // then it is judged anew

static uint16_t magnitude(int16_t value)
{
    return value < 0 ? (uint16_t)-value : (uint16_t)value;
}

static int8_t sign_of(int32_t value)
{
    return value > 0 ? 1 : value < 0 ? -1 : 0;
}

static uint16_t lesser(uint16_t a, uint16_t b)
{
    return a < b ? a : b;
}

static uint8_t add_capped(uint8_t value, uint8_t more)
{
    return more > UINT8_MAX - value ? UINT8_MAX : (uint8_t)(value + more);
}

static uint16_t positive(int32_t value)
{
    return value > 0 ? (uint16_t)value : 0;
}

void watch_init(struct watch *watch, const struct watch_model models[DRIVE_SIDES])
{
    *watch = (struct watch){0};
    for (uint8_t i = 0; i < DRIVE_SIDES; i++) {
        struct watch_side *side = &watch->sides[i];
        uint16_t um = models[i].um_per_count;
        uint32_t way_um = um > WAY_LEAST_UM ? um : WAY_LEAST_UM; // times 2.5
        side->um_per_count = um;
        side->static_duty = (uint16_t)models[i].static_duty;
        side->stood = STANDING_TICKS; // after a reset it may roll, and no motor drives it
        side->velocity_q8 = (uint16_t)models[i].velocity_q8;
        side->way_q4 = way_um * 8u; // a tick at one sixteenth of a mm/s is 5/16 um
        // At three quarters of the speed that the duty should give: way * velocity_q8 / 256 / 0.75
        // and, since what counts is the first count, four fifths of that way.
        side->pushed_most = way_um * (uint16_t)models[i].velocity_q8 / 30u + 1u;
    }
}

// --- One wheel -------------------------------------------------------------------------------------

static bool is_driven(const struct watch_wheel *wheel)
{
    return wheel->setpoint_q4 != 0 && sign_of(wheel->duty) == sign_of(wheel->setpoint_q4);
}

// With this duty a wheel goes on at its pace, if it has one and is not being slowed down.
static bool keeps_pace(const struct watch_side *side, uint16_t told_q4, uint16_t duty)
{
    uint32_t needed = side->static_duty + ((uint32_t)side->velocity_q8 * told_q4 >> 8);
    bool steady = side->turned >= PACED_COUNTS && side->pace_q4 >= told_q4 - told_q4 / 5u
               && side->pace_q4 <= told_q4 + told_q4 / 4u;
    return steady && told_q4 >= ORDINARY_Q4 && duty >= needed / 8u * 5u
        && duty >= side->lately_duty - side->lately_duty / 8u;
}

static int16_t counts_beyond(const struct watch_side *side, const struct watch_wheel *wheel, uint16_t from)
{
    return (int16_t)((int16_t)(uint16_t)((uint16_t)wheel->count - from) * side->direction);
}

static void get_further(struct watch_side *side, const struct watch_wheel *wheel)
{
    side->told_q4 = side->asked_q4 = side->paced_q4 = side->pushed = 0;
    side->silent = 0;
    side->retreated = false;
    side->pace_q4 = positive((int32_t)wheel->speed_q4 * side->direction);
}

static void follow(struct watch_side *side, const struct watch_wheel *wheel)
{
    side->lately_duty = (uint16_t)(side->lately_duty - (side->lately_duty >> LATELY_SHIFT));
    if (side->lately_duty < magnitude(wheel->duty))
        side->lately_duty = magnitude(wheel->duty);
    int8_t direction = sign_of(wheel->setpoint_q4);
    if (direction != side->direction) {
        side->direction = direction;
        get_further(side, wheel);
        side->turned = 0;
        side->furthest = side->mark = (uint16_t)wheel->count;
        side->rolling_q4 = positive(-(int32_t)wheel->speed_q4 * direction);
    } else if (counts_beyond(side, wheel, side->mark) > 0) {
        side->mark = (uint16_t)wheel->count;
        get_further(side, wheel);
        if (side->turned < PACED_COUNTS)
            side->turned++;
        if (counts_beyond(side, wheel, side->furthest) > 0)
            side->furthest = (uint16_t)wheel->count;
    } else if (counts_beyond(side, wheel, side->mark) < -1) { // it rolls the other way, and must come back
        side->mark = (uint16_t)wheel->count;
        get_further(side, wheel);
    } else if (is_driven(wheel)) {
        uint16_t told_q4 = magnitude(wheel->setpoint_q4), duty = magnitude(wheel->duty);
        side->told_q4 += told_q4;
        if (told_q4 >= ORDINARY_Q4)
            side->asked_q4 += told_q4;
        if (keeps_pace(side, told_q4, duty))
            side->paced_q4 += lesser(told_q4, side->pace_q4);
        side->pushed += positive((int32_t)duty - side->static_duty - SURE_MARGIN);
        side->silent = add_capped(side->silent, 1);
        side->retreated = counts_beyond(side, wheel, side->mark) < 0;
    }
}

static bool owes(const struct watch_side *side, uint32_t asked_q4)
{
    return side->asked_q4 >= asked_q4 + side->way_q4;
}

// It should have got further by now.
static bool is_missed(const struct watch_side *side)
{
    if (side->retreated && side->silent >= RETREAT_TICKS && side->paced_q4 >= side->way_q4 / 8u * 5u)
        return true;
    bool turning_back = side->turned == 0 && (side->rolling_q4 != 0 || side->retreated); // or reversed
    uint32_t pushed_most = turning_back ? 2u * side->pushed_most : side->pushed_most;
    return side->silent >= MISSED_TICKS
        && (side->paced_q4 >= side->way_q4 || side->pushed >= pushed_most || owes(side, DEAD_ASKED)
            || side->told_q4 >= TOLD_MOST);
}

static bool is_stalled(const struct watch_side *side)
{
    return side->silent >= STALL_TICKS && (is_missed(side) || owes(side, STALL_ASKED));
}

// It may be about to be missed.
static bool is_quiet(const struct watch_side *side)
{
    return side->silent >= QUIET_TICKS && side->told_q4 >= side->way_q4 / 8u * 5u;
}

static bool counts_backward(const struct watch_side *side, const struct watch_wheel *wheel)
{
    if (!is_driven(wheel))
        return false;
    int32_t back = -(int32_t)counts_beyond(side, wheel, side->furthest);
    int32_t rolls_um = (int32_t)side->rolling_q4 * ROLL_OUT_UM_PER_Q4;
    return back > 1 && back * side->um_per_count > REVERSED_UM + rolls_um;
}

static bool runs_away(struct watch_side *side, const struct watch_wheel *wheel, bool coasting)
{
    uint16_t told_q4 = magnitude(wheel->setpoint_q4), felt_q4 = magnitude(wheel->speed_q4);
    side->lately_q4 = (uint16_t)(side->lately_q4 - (side->lately_q4 >> LATELY_SHIFT));
    if (side->lately_q4 < told_q4)
        side->lately_q4 = told_q4;

    if (told_q4 != 0)
        side->stood = 0;
    else if (coasting)
        side->stood = STANDING_TICKS;
    else if (felt_q4 < STANDING_Q4 && side->stood < STANDING_TICKS)
        side->stood++;
    bool free = side->stood == STANDING_TICKS;
    if (free && side->lately_q4 < felt_q4)
        side->lately_q4 = felt_q4;

    if (felt_q4 <= side->lately_q4 + side->lately_q4 / 4 + FAST_MARGIN_Q4)
        side->fast = 0;
    else if (felt_q4 <= side->lately_q4 + side->lately_q4 / 2 + FAR_MARGIN_Q4)
        side->fast = add_capped(side->fast, 1);
    else
        side->fast = add_capped(side->fast, FAR_WEIGHT);
    return side->fast >= FAST_MOST;
}

// --- Both wheels -----------------------------------------------------------------------------------

static int32_t turned_um(const struct watch *watch, const struct watch_wheel *wheels, uint8_t side)
{
    return (wheels[side].count - watch->turn_from[side]) * watch->sides[side].um_per_count;
}

static bool turns_backward(struct watch *watch, const struct watch_wheel wheels[DRIVE_SIDES])
{
    int32_t told_q4 = (int32_t)wheels[DRIVE_LEFT].setpoint_q4 - wheels[DRIVE_RIGHT].setpoint_q4;
    int32_t felt_q4 = (int32_t)wheels[DRIVE_LEFT].speed_q4 - wheels[DRIVE_RIGHT].speed_q4;
    int8_t turn = told_q4 >= TURN_Q4 ? 1 : told_q4 <= -TURN_Q4 ? -1 : 0;
    if (turn != watch->turn) {
        watch->turn = turn;
        watch->turn_told = 0;
        watch->turn_rolling_q4 = positive(-felt_q4 * turn);
        for (uint8_t side = 0; side < DRIVE_SIDES; side++)
            watch->turn_from[side] = wheels[side].count;
    }
    if (turn == 0)
        return false;
    watch->turn_told += (uint32_t)(told_q4 * turn);

    int32_t left_um = turned_um(watch, wheels, DRIVE_LEFT), right_um = turned_um(watch, wheels, DRIVE_RIGHT);
    int32_t back_um = (right_um - left_um) * turn;
    int32_t way_um = (left_um < 0 ? -left_um : left_um) + (right_um < 0 ? -right_um : right_um);
    int32_t two_counts_um = 2 * (int32_t)watch->sides[DRIVE_LEFT].um_per_count;
    int32_t most_um =
        TURN_UM + two_counts_um + (int32_t)watch->turn_rolling_q4 * ROLL_OUT_UM_PER_Q4 + way_um / UNLIKE_DIVISOR;
    if (way_um > TURN_LONGEST_UM)
        watch->turn = 0;
    return watch->turn_told >= TURN_TOLD && back_um > most_um;
}

uint8_t watch_update(struct watch *watch, const struct watch_wheel wheels[DRIVE_SIDES], bool coasting)
{
    uint8_t driven = 0, missed = 0, quiet = 0, stalled = 0; // wheels
    bool away = false, backward = false;
    for (uint8_t i = 0; i < DRIVE_SIDES; i++) {
        struct watch_side *side = &watch->sides[i];
        away |= runs_away(side, &wheels[i], coasting);
        follow(side, &wheels[i]);
        backward |= counts_backward(side, &wheels[i]);
        if (is_driven(&wheels[i])) {
            driven++;
            missed = (uint8_t)(missed + is_missed(side));
            quiet = (uint8_t)(quiet + is_quiet(side));
            stalled = (uint8_t)(stalled + is_stalled(side));
        }
    }
    backward |= turns_backward(watch, wheels);

    if (away)
        return FAULT_RUNAWAY;
    if (backward)
        return FAULT_ENCODER_REVERSED;
    if (missed > 0 && (driven == 1 || quiet < driven))
        return FAULT_ENCODER_DEAD;
    if (stalled > 0 && stalled == driven)
        return FAULT_STALL;
    return FAULT_NONE;
}
