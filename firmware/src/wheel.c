// Where one wheel is and how fast it turns between its edges. See wheel.h.
#include "wheel.h" // this file's manual

#include "within.h" // within

#define LAG_SHARE_Q8 21       // of what is missing to the speed told that is gained in a tick: a lag of 60 ms
#define FRICTION_Q4 INT32_C(100) // a braked wheel slows down as if it were told to go back this fast
#define TICKS_MOST 60         // further back nothing is averaged
#define TICKS_LEAST 10        // errors over less than the lag are no errors in speed
#define TICK_IN_PARTS(us) ((int32_t)(us) * 105 / 2048) // of a tick, times 256
#define AGE_MOST_US 20000u    // of an edge that came in this tick
#define RELEASED_Q4 2000      // fastest a wheel is by the edge that shows it is no longer held

#define PUSH_Q12 1024         // a held wheel, however slow it was told to go, is as much slower every tick

#define EDGES_TO_PLACE 5      // the last of them tells where the wheel began
#define SLOW_START_TICKS 48   // a wheel that needs longer for its first edge did not gain speed evenly
#define UNLEARNED_Q8 300      // drift after a few edges is only learned in part: what it will be, times 256
#define STEP_LEAST_Q4 8       // lest anything be divided by less

void wheel_init(struct wheel *wheel, uint8_t learn_q8, int16_t drift_limit_q4)
{
    *wheel = (struct wheel){.learn_q8 = learn_q8, .drift_limit_q4 = drift_limit_q4};
}

static void learn(struct wheel *wheel, int32_t change_q12)
{
    wheel->drift_q12 = within(wheel->drift_q12 + change_q12, (int32_t)wheel->drift_limit_q4 * 256);
}

void wheel_start(struct wheel *wheel, int8_t direction)
{
    wheel->drift_q12 = 0;
    learn(wheel, (int32_t)direction * WHEEL_DRIFT_Q4 * 256);
    wheel->ticks = wheel->stuck = wheel->first_share_q8 = 0;
    if (wheel->edges > 0) {
        wheel->edges = EDGES_TO_PLACE; // where it began stays as it is known
    } else {
        wheel->edge_um += wheel->part_16um / 16; // it begins anew
        wheel->part_16um = 0;
    }
}

int16_t wheel_speed_q4(const struct wheel *wheel)
{
    return (int16_t)(wheel->speed_q12 / 256);
}

// Travel wraps after 4 km, which a signed sum may not.
static int32_t sum_um(int32_t a, int32_t b)
{
    return (int32_t)((uint32_t)a + (uint32_t)b);
}

int32_t wheel_travel_um(const struct wheel *wheel)
{
    return sum_um(wheel->edge_um, wheel->part_16um / 16);
}

// Travel at the present speed in so many 256ths of a tick.
static int32_t way_16um(const struct wheel *wheel, int32_t parts)
{
    return wheel->speed_q12 / 256 * 5 * parts / 256; // mm/s for 5 ms
}

static void gain_speed(struct wheel *wheel, int32_t speed_q12)
{
    wheel->speed_q12 = within(wheel->speed_q12 + speed_q12, (int32_t)WHEEL_SPEED_Q4 * 256);
}

// --- The simple motor ------------------------------------------------------------------------------

static void turn_as_told(struct wheel *wheel)
{
    if (wheel->told_q4 != 0) {
        gain_speed(wheel, ((int32_t)wheel->told_q4 * 256 - wheel->speed_q12) * LAG_SHARE_Q8 / 256);
        wheel->ticks = (uint8_t)(wheel->ticks + (wheel->ticks < TICKS_MOST));
        wheel->first_share_q8 =
            (uint8_t)(wheel->first_share_q8 + (255 - wheel->first_share_q8) * LAG_SHARE_Q8 / 256);
    } else {
        int32_t before = wheel->speed_q12;
        int32_t friction = before > 0 ? FRICTION_Q4 * 256 : before < 0 ? -FRICTION_Q4 * 256 : 0;
        gain_speed(wheel, -(before + friction) * LAG_SHARE_Q8 / 256);
        if ((before > 0) != (wheel->speed_q12 > 0))
            wheel->speed_q12 = 0;
    }
    wheel->part_16um += way_16um(wheel, 256);
}

// --- Edges -----------------------------------------------------------------------------------------

// How fast it was wrong by, if so much way is missing since the last edge.
static int32_t error_q12(const struct wheel *wheel, int32_t missing_16um)
{
    return missing_16um * 51 / (wheel->ticks + TICKS_LEAST); // 256 / 5
}

// Way from the start to the first edge, if the drift was so much more than then believed.
static uint16_t way_to_first_um(const struct wheel *wheel, int32_t drift_q4, uint16_t um_per_count)
{
    if (wheel->first_ticks > SLOW_START_TICKS)
        return um_per_count / 2;
    int32_t speed = wheel->first_speed_q4 + within(drift_q4, WHEEL_SPEED_Q4) * wheel->first_share_q8 / 256;
    if (speed <= 0)
        return 0;
    uint32_t square = (uint32_t)speed * (uint32_t)speed;
    uint32_t way = square / (uint16_t)wheel->first_step_q4 * 5u / 32u; // sixteenths of mm/s for 5 ms, halved
    return way < um_per_count ? (uint16_t)way : um_per_count;
}

// The first edge. Where it began in its count is unknown: what it had gained in every tick is kept.
static void begin_at_first_edge(struct wheel *wheel, int8_t direction, uint16_t um_per_count)
{
    int32_t step = (int32_t)wheel->told_q4 * direction / (wheel->ticks + 1);
    wheel->first_ticks = step >= STEP_LEAST_Q4 ? wheel->ticks : UINT8_MAX;
    wheel->first_step_q4 = (int16_t)step;
    wheel->first_speed_q4 = (int16_t)(wheel_speed_q4(wheel) * direction);
    wheel->first_drift_q4 = (int16_t)(wheel->drift_q12 / 256 * direction);
    wheel->first_um = way_to_first_um(wheel, -wheel->first_drift_q4, um_per_count);
    wheel->edge_um += (int32_t)wheel->first_um * direction;
}

static void learn_where_it_began(struct wheel *wheel, int8_t direction, uint16_t um_per_count)
{
    int32_t more_q4 = wheel->drift_q12 / 256 * direction - wheel->first_drift_q4;
    uint16_t first_um = way_to_first_um(wheel, more_q4 * UNLEARNED_Q8 / 256, um_per_count);
    wheel->edge_um += ((int32_t)first_um - wheel->first_um) * direction;
    wheel->first_um = first_um;
}

// The edge that came is `missing` further than the wheel was taken to be.
static void correct_by_edge(struct wheel *wheel, int8_t direction, int32_t missing_16um)
{
    if (wheel->stuck >= WHEEL_STUCK_TICKS) { // when it came loose is unknown
        int16_t told = (int16_t)(wheel->told_q4 * direction);
        int32_t speed_q4 = told < 0 ? 0 : told < RELEASED_Q4 ? told : RELEASED_Q4;
        wheel->speed_q12 = speed_q4 * direction * 256;
        return;
    }
    int32_t correction = error_q12(wheel, missing_16um);
    gain_speed(wheel, correction);
    if (!(wheel->full && (correction < 0) == (wheel->told_q4 > 0)))
        learn(wheel, correction * wheel->learn_q8 / 256);
}

static uint16_t border_of(const struct encoder *encoder)
{
    return (uint16_t)((uint16_t)encoder->count + (encoder->direction < 0));
}

static void take_edge(struct wheel *wheel, const struct encoder *encoder)
{
    int8_t direction = encoder->direction;
    int32_t count_16um = (int32_t)encoder->um_per_count * 16;
    int16_t moved = (int16_t)(border_of(encoder) - wheel->border);
    uint32_t age_us = encoder->edge_age_us < AGE_MOST_US ? encoder->edge_age_us : AGE_MOST_US;
    int32_t age = TICK_IN_PARTS(age_us);

    if (wheel->edges == 0) {
        begin_at_first_edge(wheel, direction, encoder->um_per_count);
        correct_by_edge(wheel, direction, 0);
    } else {
        if (wheel->edges < EDGES_TO_PLACE && direction != wheel->direction)
            wheel->edges = EDGES_TO_PLACE;
        else if (wheel->edges == EDGES_TO_PLACE - 1)
            learn_where_it_began(wheel, direction, encoder->um_per_count);
        int32_t missing = moved * count_16um - (wheel->part_16um - way_16um(wheel, age));
        wheel->edge_um = sum_um(wheel->edge_um, moved * (int32_t)encoder->um_per_count);
        correct_by_edge(wheel, direction, within(missing, 2 * count_16um));
    }
    wheel->border = border_of(encoder);
    wheel->direction = direction;
    wheel->edges = (uint8_t)(wheel->edges + (wheel->edges < EDGES_TO_PLACE));
    wheel->ticks = wheel->stuck = 0;
    wheel->part_16um = way_16um(wheel, age);
}

// The next edge has not come: the wheel is no further.
static void stay_within_count(struct wheel *wheel, int32_t count_16um)
{
    int32_t most = wheel->edges > 0 && wheel->direction < 0 ? 0 : count_16um;
    int32_t least = wheel->edges > 0 && wheel->direction > 0 ? 0 : -count_16um;
    int32_t over = wheel->part_16um > most    ? wheel->part_16um - most
                   : wheel->part_16um < least ? wheel->part_16um - least
                                              : 0;
    if (over == 0)
        return;
    wheel->part_16um -= over;
    int32_t correction = -error_q12(wheel, over);
    gain_speed(wheel, correction);
    bool held = wheel->stuck >= WHEEL_STUCK_TICKS;
    if (held && correction > -PUSH_Q12 && correction < PUSH_Q12)
        correction = over > 0 ? -PUSH_Q12 : PUSH_Q12;
    if (!wheel->full && !(held && wheel->hard))
        learn(wheel, correction * wheel->learn_q8 / 256);
    wheel->stuck = (uint8_t)(wheel->stuck + !held);
}

void wheel_update(struct wheel *wheel, const struct encoder *encoder)
{
    if (!wheel->placed) {
        wheel->placed = true;
        wheel->border = border_of(encoder);
        wheel->direction = encoder->direction;
    }
    turn_as_told(wheel);
    if (border_of(encoder) != wheel->border || encoder->direction != wheel->direction)
        take_edge(wheel, encoder);
    stay_within_count(wheel, (int32_t)encoder->um_per_count * 16);
}
