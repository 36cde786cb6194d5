// May the motors run, and why not: states, faults, dead-man and e-stop.
//
//   BOOT     since reset no host has shown that it speaks this schema; only HELLO leads out
//   READY    standing; DRIVE and MOVE lead out
//   DRIVING  motors may run while the setpoint is alive
//   MOVING   on a move of known length: motors may run while it is kept alive; at its end READY
//   STOPPED  after STOP the wheels still turn; becomes READY when they stand, or DRIVING by a new DRIVE
//   FAULT    latched; only CLEAR with this start's nonce leads out, and only once the cause is gone
//
// The dead-man needs no switching on: DRIVING and MOVING end in FAULT_LINK_LOST when SUPERVISOR_HOLD_MAX_US
// pass without a DRIVE, or a KEEP_ALIVE, being obeyed. One may ask for less: motors are then off at its
// deadline, but the fault still waits for the dead-man, so that one late frame does not end a session. An
// e-stop is honoured in any state and replaces another fault; otherwise the first cause is kept until CLEAR.
// A start after a reset by the watchdog begins in FAULT.
//
// All transitions are one table in supervisor.c, first match wins. Times are the robot's clock in
// microseconds; it may wrap. Refusals are enum refusal of messages.h, 0 meaning obeyed.
#ifndef SUPERVISOR_H
#define SUPERVISOR_H

#include <stdbool.h> // bool
#include <stdint.h>  // integers of known width

#include "messages.h" // enum state, enum fault, enum refusal, DEAD_MAN_US

// Motors are off by DEAD_MAN_US after the last command obeyed: they are turned off in a tick, one comes every
// 5 ms, and a tick may be a little late.
#define SUPERVISOR_HOLD_MAX_US (DEAD_MAN_US - UINT32_C(6000))

#define SUPERVISOR_TICK_LATE_US UINT32_C(15000)    // since the tick before: two were missed
#define SUPERVISOR_BATTERY_LOW_US UINT32_C(500000) // low for this long is no sag from a starting motor
#define SUPERVISOR_BATTERY_RECOVERY_MV 200u        // above the minimum before CLEAR is obeyed

struct supervisor {
    uint8_t state; // enum state
    uint8_t fault; // enum fault; FAULT_NONE outside STATE_FAULT

    uint32_t boot_nonce;
    uint32_t standing;       // inputs that hold until they change, a set of bits private to supervisor.c
    uint32_t obeyed_us;      // when the last DRIVE, MOVE or KEEP_ALIVE was
    uint32_t hold_us;        // how long after that it lives
    uint32_t tick_us;        // when the last tick was
    uint32_t battery_sag_us; // since when the battery has been below minimum
    uint16_t battery_min_mv;
    bool alive;           // its deadline has not passed
    bool coasting;        // motors that may not run are open, not shorted
    bool ticked;          // there has been a tick
    bool battery_sagging; // below minimum, but perhaps not for long
};

// What the supervisor is told every tick.
struct supervisor_senses {
    uint16_t battery_mv; // 0: not measured, and then never called low
    bool estop_pressed;  // the button, now
    bool wheels_still;   // neither encoder sees motion
    uint8_t wheels;      // enum fault: what watch_update() finds wrong with them
};

// Everything off. boot_nonce: another number after every start. reset_cause: enum reset_cause.
void supervisor_init(struct supervisor *supervisor, uint32_t boot_nonce, uint8_t reset_cause);

// A battery with less is low; 0 for no watch on it, as at first.
static inline void supervisor_watch_battery(struct supervisor *supervisor, uint16_t min_mv)
{
    supervisor->battery_min_mv = min_mv;
}

// A host names its schema. One that differs ends any session: its later frames might mean something else.
uint8_t supervisor_hello(struct supervisor *supervisor, uint8_t protocol_version, uint32_t schema_hash);

bool supervisor_in_session(const struct supervisor *supervisor);

// A setpoint that dies at expires_us. If obeyed, motors may run until then, or the dead-man if that is first.
uint8_t supervisor_drive(struct supervisor *supervisor, uint32_t now_us, uint32_t expires_us);

// A move begins, alive until expires_us likewise; then it is kept alive, and at last it has ended.
uint8_t supervisor_move(struct supervisor *supervisor, uint32_t now_us, uint32_t expires_us);
uint8_t supervisor_keep_alive(struct supervisor *supervisor, uint32_t now_us, uint32_t expires_us);
void supervisor_move_ended(struct supervisor *supervisor);

// how: enum stop_how; only a host in session can make the motors coast.
void supervisor_stop(struct supervisor *supervisor, uint8_t how);

void supervisor_estop(struct supervisor *supervisor);

uint8_t supervisor_clear(struct supervisor *supervisor, uint32_t boot_nonce);

// Every tick: time passes, senses change.
void supervisor_tick(struct supervisor *supervisor, uint32_t now_us, const struct supervisor_senses *senses);

// The one question every motor output asks first.
static inline bool supervisor_may_run(const struct supervisor *supervisor)
{
    return (supervisor->state == STATE_DRIVING || supervisor->state == STATE_MOVING) && supervisor->alive;
}

// And the next one, when they may not: shorted or open.
static inline bool supervisor_coasts(const struct supervisor *supervisor)
{
    return supervisor->coasting;
}

// The robot stands, and nothing moves it before another message: what a robot is may be changed now.
bool supervisor_stands(const struct supervisor *supervisor);

#endif
