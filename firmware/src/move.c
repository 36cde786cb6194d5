// A move from standstill to standstill: profile, heading hold, braking by the way that is left. See move.h.
#include "move.h" // this file's manual

#define CREEP_Q4 320        // 20 mm/s, slowest of the profile: less is lost in the dead zone of a motor
#define APPROACH_UM 32      // of way left for every q4 of speed: half of it is left after 0.36 s
#define LEVEL_UM 32         // that one wheel is ahead of the other, for every q4 of speed taken off it
#define ROLL_OUT_TICKS 8    // a wheel that is braked rolls as far as it would have gone in these
#define STILL_TICKS 20      // without any travel: the wheels stand
#define WAY_MOST_UM 400000  // with more than this left no speed needs braking
#define STEP_MOST_Q4 1700   // lest their product exceed 32 bits

static int32_t least(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

static void begin(struct move *move, const struct drive_limits *limits, int32_t left_way_um, bool turn,
                  int32_t speed_q4, int32_t left_um, int32_t right_um)
{
    int8_t sign = left_way_um < 0 ? -1 : 1;
    *move = (struct move){
        .start_um = {left_um, right_um},
        .way_um = left_way_um * sign,
        .cruise_q4 = (int16_t)least(speed_q4, limits->speed_q4),
        .step_q4 = (int16_t)least(limits->step_q4, STEP_MOST_Q4),
        .sign = {sign, turn ? (int8_t)-sign : sign},
        .last_um = {left_um, right_um},
    };
}

void move_begin_straight(struct move *move, const struct drive_limits *limits, int16_t distance_mm,
                         uint16_t speed_mm_s, int32_t left_um, int32_t right_um)
{
    begin(move, limits, (int32_t)distance_mm * 1000, false, (int32_t)speed_mm_s * 16, left_um, right_um);
}

void move_begin_turn(struct move *move, const struct drive_limits *limits, int16_t angle_mrad,
                     uint16_t rate_mrad_s, int32_t left_um, int32_t right_um)
{
    int32_t half_um = limits->track_um / 2; // a radian's way; times angle_mrad it would exceed 32 bits
    int32_t way_um = half_um / 1000 * angle_mrad + half_um % 1000 * angle_mrad / 1000;
    int32_t speed_q4 = limits->track_um / 25 * least(rate_mrad_s, INT16_MAX) / 5000;
    begin(move, limits, way_um, true, speed_q4 > 0 ? speed_q4 : 1, left_um, right_um);
}

// The profile's speed this tick, with so much way left: up by the ramp, down by half of it, and ever slower
// near the end, where every count must be waited for.
static int16_t next_speed_q4(const struct move *move, int32_t left_um)
{
    int32_t ramp = least((int32_t)move->speed_q4 + move->step_q4, move->cruise_q4);
    int32_t slowest = least(CREEP_Q4, ramp), speed = ramp;
    int32_t room_um = left_um > 0 ? least(left_um, WAY_MOST_UM) : 0;
    int32_t braked = room_um * move->step_q4 * 3; // speed^2 that half the ramp brakes on it: 3.2 * way * step
    while (speed * speed > braked && speed > CREEP_Q4)
        speed -= CREEP_Q4 / 16;
    speed = least(speed, room_um / APPROACH_UM);
    return (int16_t)(speed > slowest ? speed : slowest);
}

// Of the way, for one wheel.
static int32_t left_of(const struct move *move, uint8_t side, int32_t at_um)
{
    int32_t gone_um = (int32_t)((uint32_t)at_um - (uint32_t)move->start_um[side]); // travel may wrap
    return move->way_um - gone_um * move->sign[side];
}

bool move_update(struct move *move, int32_t left_um, int32_t right_um, int16_t setpoint_q4[DRIVE_SIDES])
{
    const int32_t at_um[DRIVE_SIDES] = {left_um, right_um};
    const int32_t to_go[DRIVE_SIDES] = {
        left_of(move, DRIVE_LEFT, left_um),
        left_of(move, DRIVE_RIGHT, right_um),
    };
    int32_t speed = move->speed_q4 = next_speed_q4(move, to_go[DRIVE_LEFT] / 2 + to_go[DRIVE_RIGHT] / 2);
    int32_t ahead = (to_go[DRIVE_RIGHT] - to_go[DRIVE_LEFT]) / LEVEL_UM; // the left one, in speed
    ahead = ahead > 0 ? least(ahead, speed / 2) : -least(-ahead, speed / 2);
    const int32_t wanted[DRIVE_SIDES] = {speed - ahead, speed + ahead};

    bool moving = false;
    for (uint8_t side = 0; side < DRIVE_SIDES; side++) {
        if (to_go[side] <= speed * ROLL_OUT_TICKS * 5 / 16) // mm/s for 5 ms
            move->arrived[side] = true;
        int32_t wheel = move->arrived[side] ? 0 : least(wanted[side], INT16_MAX);
        setpoint_q4[side] = (int16_t)(wheel * move->sign[side]);
        moving = moving || !move->arrived[side] || at_um[side] != move->last_um[side];
        move->last_um[side] = at_um[side];
    }
    move->still = moving ? 0 : (uint8_t)(move->still + 1);
    return move->still >= STILL_TICKS;
}

void move_pause(struct move *move)
{
    move->speed_q4 = 0;
    move->still = 0;
}
