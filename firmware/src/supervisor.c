// May the motors run, and why not: one table of transitions, and the inputs that drive it.
#include "supervisor.h" // this file's manual

#include "flash.h" // IN_FLASH

// Inputs, one bit each. The first group holds for a single update, the second until it changes.
#define SAW_FOREIGN_HELLO (UINT32_C(1) << 0)
#define SAW_DRIVE (UINT32_C(1) << 1)
#define SAW_MOVE (UINT32_C(1) << 2)
#define SAW_STOP (UINT32_C(1) << 3)
#define SAW_ESTOP (UINT32_C(1) << 4)
#define SAW_CLEAR (UINT32_C(1) << 5)
#define MOVE_ENDED (UINT32_C(1) << 6)
#define DEAD_MAN (UINT32_C(1) << 7)
#define TICK_LATE (UINT32_C(1) << 8)

#define IN_SESSION (UINT32_C(1) << 16)
#define ESTOP_PRESSED (UINT32_C(1) << 17)
#define BATTERY_LOW (UINT32_C(1) << 18)
#define WHEELS_STILL (UINT32_C(1) << 19)
#define RUNNING_AWAY (UINT32_C(1) << 20)
#define ENCODER_REVERSED (UINT32_C(1) << 21)
#define ENCODER_DEAD (UINT32_C(1) << 22)
#define STALLED (UINT32_C(1) << 23)

#define IN(state) (1u << (state))
#define ANYWHERE 0xFFu
#define UNFAULTED (ANYWHERE & ~IN(STATE_FAULT))

struct transition {
    uint8_t from;   // set of states, IN() each
    uint32_t needs; // inputs that must all hold
    uint8_t to;
    uint8_t fault;
};

// The first row that fits is taken, at most one an update. What keeps a fault standing comes before what
// clears it, so CLEAR works only when nothing is wrong any more.
static const IN_FLASH struct transition transitions[] = {
    {ANYWHERE, ESTOP_PRESSED, STATE_FAULT, FAULT_ESTOP_BUTTON},
    {ANYWHERE, SAW_ESTOP, STATE_FAULT, FAULT_ESTOP_FRAME},

    {UNFAULTED, RUNNING_AWAY, STATE_FAULT, FAULT_RUNAWAY},
    {UNFAULTED, ENCODER_REVERSED, STATE_FAULT, FAULT_ENCODER_REVERSED},
    {UNFAULTED, ENCODER_DEAD, STATE_FAULT, FAULT_ENCODER_DEAD},
    {UNFAULTED, STALLED, STATE_FAULT, FAULT_STALL},
    {UNFAULTED, TICK_LATE, STATE_FAULT, FAULT_OVERRUN},
    {UNFAULTED, BATTERY_LOW, STATE_FAULT, FAULT_BATTERY_LOW},
    {IN(STATE_DRIVING) | IN(STATE_MOVING), DEAD_MAN, STATE_FAULT, FAULT_LINK_LOST},

    {IN(STATE_FAULT), SAW_CLEAR | RUNNING_AWAY, STATE_FAULT, FAULT_RUNAWAY},
    {IN(STATE_FAULT), SAW_CLEAR | BATTERY_LOW, STATE_FAULT, FAULT_BATTERY_LOW},
    {IN(STATE_FAULT), SAW_CLEAR | IN_SESSION | WHEELS_STILL, STATE_READY, FAULT_NONE},
    {IN(STATE_FAULT), SAW_CLEAR | IN_SESSION, STATE_STOPPED, FAULT_NONE},
    {IN(STATE_FAULT), SAW_CLEAR, STATE_BOOT, FAULT_NONE},

    {UNFAULTED, SAW_FOREIGN_HELLO, STATE_BOOT, FAULT_NONE},
    {IN(STATE_BOOT), IN_SESSION | WHEELS_STILL, STATE_READY, FAULT_NONE},
    {IN(STATE_BOOT), IN_SESSION, STATE_STOPPED, FAULT_NONE}, // it was told to drive before, or pushed

    {IN(STATE_DRIVING) | IN(STATE_MOVING), SAW_STOP, STATE_STOPPED, FAULT_NONE},
    {UNFAULTED & ~IN(STATE_BOOT), SAW_DRIVE, STATE_DRIVING, FAULT_NONE},
    {IN(STATE_READY), SAW_MOVE, STATE_MOVING, FAULT_NONE},
    {IN(STATE_MOVING), MOVE_ENDED, STATE_READY, FAULT_NONE},
    {IN(STATE_STOPPED), WHEELS_STILL, STATE_READY, FAULT_NONE},
};

static void update(struct supervisor *supervisor, uint32_t saw)
{
    uint32_t inputs = saw | supervisor->standing;
    for (uint8_t i = 0; i < sizeof transitions / sizeof transitions[0]; i++) {
        const IN_FLASH struct transition *row = &transitions[i];
        if ((row->from & IN(supervisor->state)) && (inputs & row->needs) == row->needs) {
            supervisor->state = row->to;
            supervisor->fault = row->fault;
            if (row->to == STATE_FAULT)
                supervisor->coasting = false;
            return;
        }
    }
}

static void set_standing(struct supervisor *supervisor, uint32_t input, bool holds)
{
    if (holds)
        supervisor->standing |= input;
    else
        supervisor->standing &= ~input;
}

void supervisor_init(struct supervisor *supervisor, uint32_t boot_nonce, uint8_t reset_cause)
{
    bool hung = reset_cause == RESET_WATCHDOG;
    *supervisor = (struct supervisor){
        .state = hung ? STATE_FAULT : STATE_BOOT,
        .fault = hung ? FAULT_WATCHDOG : FAULT_NONE,
        .boot_nonce = boot_nonce,
        .standing = WHEELS_STILL, // until the encoders say otherwise
    };
}

// --- Messages --------------------------------------------------------------------------------------

uint8_t supervisor_hello(struct supervisor *supervisor, uint8_t protocol_version, uint32_t schema_hash)
{
    bool ours = protocol_version == PROTOCOL_VERSION && schema_hash == SCHEMA_HASH;
    set_standing(supervisor, IN_SESSION, ours);
    update(supervisor, ours ? 0 : SAW_FOREIGN_HELLO);
    return ours ? 0 : REFUSED_SCHEMA;
}

bool supervisor_in_session(const struct supervisor *supervisor)
{
    return (supervisor->standing & IN_SESSION) != 0;
}

// May anything run that lives until expires_us?
static uint8_t refusal_of(const struct supervisor *supervisor, uint32_t now_us, uint32_t expires_us)
{
    if (!supervisor_in_session(supervisor))
        return REFUSED_NO_SESSION;
    if (supervisor->state == STATE_FAULT)
        return REFUSED_FAULT_LATCHED;
    int32_t ahead_us = (int32_t)(expires_us - now_us);
    if (ahead_us <= 0)
        return REFUSED_EXPIRED;
    if (ahead_us > (int32_t)DRIVE_AHEAD_MAX_US)
        return REFUSED_BAD_VALUE;
    return 0;
}

static void live_until(struct supervisor *supervisor, uint32_t now_us, uint32_t expires_us)
{
    uint32_t ahead_us = expires_us - now_us;
    supervisor->obeyed_us = now_us;
    supervisor->hold_us = ahead_us < SUPERVISOR_HOLD_MAX_US ? ahead_us : SUPERVISOR_HOLD_MAX_US;
    supervisor->alive = true;
    supervisor->coasting = false;
}

uint8_t supervisor_drive(struct supervisor *supervisor, uint32_t now_us, uint32_t expires_us)
{
    uint8_t refusal = refusal_of(supervisor, now_us, expires_us);
    if (refusal != 0)
        return refusal;
    update(supervisor, SAW_DRIVE);
    live_until(supervisor, now_us, expires_us);
    return 0;
}

uint8_t supervisor_move(struct supervisor *supervisor, uint32_t now_us, uint32_t expires_us)
{
    uint8_t refusal = refusal_of(supervisor, now_us, expires_us);
    if (refusal != 0)
        return refusal;
    if (supervisor->state != STATE_READY)
        return REFUSED_NOT_STANDING;
    update(supervisor, SAW_MOVE);
    live_until(supervisor, now_us, expires_us);
    return 0;
}

uint8_t supervisor_keep_alive(struct supervisor *supervisor, uint32_t now_us, uint32_t expires_us)
{
    if (supervisor->state != STATE_MOVING)
        return 0; // the move has just ended, as telemetry tells
    uint8_t refusal = refusal_of(supervisor, now_us, expires_us);
    if (refusal == 0)
        live_until(supervisor, now_us, expires_us);
    return refusal;
}

void supervisor_move_ended(struct supervisor *supervisor)
{
    update(supervisor, MOVE_ENDED);
}

void supervisor_stop(struct supervisor *supervisor, uint8_t how)
{
    supervisor->coasting =
        how == STOP_COAST && supervisor_in_session(supervisor) && supervisor->state != STATE_FAULT;
    update(supervisor, SAW_STOP);
}

void supervisor_estop(struct supervisor *supervisor)
{
    update(supervisor, SAW_ESTOP);
}

uint8_t supervisor_clear(struct supervisor *supervisor, uint32_t boot_nonce)
{
    if (boot_nonce != supervisor->boot_nonce)
        return REFUSED_BAD_NONCE;
    update(supervisor, SAW_CLEAR);
    return supervisor->state == STATE_FAULT ? REFUSED_FAULT_PERSISTS : 0;
}

bool supervisor_stands(const struct supervisor *supervisor)
{
    return supervisor->state == STATE_READY
        || (supervisor->state == STATE_FAULT && (supervisor->standing & WHEELS_STILL) != 0);
}

// --- Time ------------------------------------------------------------------------------------------

// Low only after a while, and low until clearly recovered.
static void watch_battery(struct supervisor *supervisor, uint32_t now_us, uint16_t battery_mv)
{
    uint16_t min_mv = supervisor->battery_min_mv;
    if (battery_mv == 0 || min_mv == 0 || battery_mv >= min_mv + SUPERVISOR_BATTERY_RECOVERY_MV)
        set_standing(supervisor, BATTERY_LOW, false);

    if (battery_mv == 0 || battery_mv >= min_mv) {
        supervisor->battery_sagging = false;
    } else if (!supervisor->battery_sagging) {
        supervisor->battery_sagging = true;
        supervisor->battery_sag_us = now_us;
    } else if (now_us - supervisor->battery_sag_us >= SUPERVISOR_BATTERY_LOW_US) {
        set_standing(supervisor, BATTERY_LOW, true);
    }
}

static bool tick_is_late(struct supervisor *supervisor, uint32_t now_us)
{
    bool late = supervisor->ticked && now_us - supervisor->tick_us > SUPERVISOR_TICK_LATE_US;
    supervisor->ticked = true;
    supervisor->tick_us = now_us;
    return late;
}

void supervisor_tick(struct supervisor *supervisor, uint32_t now_us, const struct supervisor_senses *senses)
{
    set_standing(supervisor, ESTOP_PRESSED, senses->estop_pressed);
    set_standing(supervisor, WHEELS_STILL, senses->wheels_still);
    set_standing(supervisor, RUNNING_AWAY, senses->wheels == FAULT_RUNAWAY);
    set_standing(supervisor, ENCODER_REVERSED, senses->wheels == FAULT_ENCODER_REVERSED);
    set_standing(supervisor, ENCODER_DEAD, senses->wheels == FAULT_ENCODER_DEAD);
    set_standing(supervisor, STALLED, senses->wheels == FAULT_STALL);
    watch_battery(supervisor, now_us, senses->battery_mv);

    uint32_t silence_us = now_us - supervisor->obeyed_us;
    if (silence_us >= supervisor->hold_us)
        supervisor->alive = false;
    uint32_t saw = silence_us >= SUPERVISOR_HOLD_MAX_US ? DEAD_MAN : 0;
    if (tick_is_late(supervisor, now_us))
        saw |= TICK_LATE;
    update(supervisor, saw);
}
