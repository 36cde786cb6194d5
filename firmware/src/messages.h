// Messages of the link: ids, payload sizes, and how each lies in its payload.
// Generated from host/link/protocol.py by `python -m host.link.generate`; do not edit.
//
// For every message NAME there is MSG_NAME (its id) and MSG_NAME_SIZE (bytes of payload), and unless it is
// empty a struct msg_name with
//     msg_name_encode(&message, payload)    writes MSG_NAME_SIZE bytes
//     msg_name_decode(&message, payload)    reads MSG_NAME_SIZE bytes
// Everything on the wire is little endian and unpadded, whatever the machine.
#ifndef MESSAGES_H
#define MESSAGES_H

#include <stdint.h> // integers of known width

#define PROTOCOL_VERSION 1u // of framing, checksum and handshake
#define SCHEMA_HASH UINT32_C(0x88FADA8C) // of every message and enumeration below
#define PARAMS_VERSION UINT32_C(0x85AB4084) // of the list of parameters, kept with them in EEPROM
#define LINK_BAUD UINT32_C(250000) // exact on a 16 MHz ATmega328P
#define DEAD_MAN_US UINT32_C(200000) // a setpoint holds no longer, whatever its DRIVE says
#define DRIVE_AHEAD_MAX_US UINT32_C(500000) // refuse a DRIVE whose deadline is further ahead
#define TELEMETRY_PERIOD_US 10000u // between two TELEMETRY
#define LINK_STATUS_PERIOD_US UINT32_C(200000) // between two LINK_STATUS
#define LINK_STALE_WINDOW 16u // sequence numbers this close behind are repeats
#define LINK_OVERHEAD 6u // bytes of id, sequence number and checksum
#define LINK_RAW_MAX_TO_ROBOT 20u // longest frame before COBS
#define LINK_RAW_MAX_TO_HOST 53u // longest frame before COBS
#define NO_EDGE_US UINT32_C(4294967295) // edge age of a wheel that has not turned

// --- Enumerations ----------------------------------------------------------------------------------

// What the supervisor allows.
enum state {
    STATE_BOOT = 0,
    STATE_READY = 1,
    STATE_DRIVING = 2,
    STATE_MOVING = 3,
    STATE_STOPPED = 4,
    STATE_FAULT = 5,
};

// Why the motors are off; the first cause is kept until CLEAR.
enum fault {
    FAULT_NONE = 0,
    FAULT_LINK_LOST = 1,
    FAULT_ESTOP_FRAME = 2,
    FAULT_ESTOP_BUTTON = 3,
    FAULT_STALL = 4,
    FAULT_ENCODER_DEAD = 5,
    FAULT_ENCODER_REVERSED = 6,
    FAULT_RUNAWAY = 7,
    FAULT_BATTERY_LOW = 8,
    FAULT_OVERRUN = 9,
    FAULT_WATCHDOG = 10,
};

// Why the robot last started.
enum reset_cause {
    RESET_UNKNOWN = 0,
    RESET_POWER_ON = 1,
    RESET_EXTERNAL = 2,
    RESET_BROWN_OUT = 3,
    RESET_WATCHDOG = 4,
};

// Why a message was not obeyed, or not to its end.
enum refusal {
    REFUSED_NONE = 0,
    REFUSED_NO_SESSION = 1,
    REFUSED_SCHEMA = 2,
    REFUSED_EXPIRED = 3,
    REFUSED_BAD_VALUE = 4,
    REFUSED_FAULT_LATCHED = 5,
    REFUSED_BAD_NONCE = 6,
    REFUSED_FAULT_PERSISTS = 7,
    REFUSED_NOT_STANDING = 8,
    REFUSED_BUSY = 9,
    REFUSED_OLD_REQUEST = 10,
    REFUSED_BY_STOP = 11,
    REFUSED_BY_DRIVE = 12,
    REFUSED_BY_FAULT = 13,
    REFUSED_NOT_STORED = 14,
};

// What became of the last request.
enum outcome {
    OUTCOME_NONE = 0,
    OUTCOME_RUNNING = 1,
    OUTCOME_DONE = 2,
    OUTCOME_ABORTED = 3,
    OUTCOME_REFUSED = 4,
};

// What STOP does with the motors.
enum stop_how {
    STOP_BRAKE = 0,
    STOP_COAST = 1,
};

// What PARAM_READ and PARAM_WRITE name.
enum param {
    PARAM_UM_PER_COUNT_LEFT = 0,
    PARAM_UM_PER_COUNT_RIGHT = 1,
    PARAM_TRACK_UM = 2,
    PARAM_SPEED_MAX_MM_S = 3,
    PARAM_ACCELERATION_MM_S2 = 4,
    PARAM_STATIC_DUTY_LEFT = 5,
    PARAM_STATIC_DUTY_RIGHT = 6,
    PARAM_VELOCITY_Q8_LEFT = 7,
    PARAM_VELOCITY_Q8_RIGHT = 8,
    PARAM_ACCELERATION_Q8 = 9,
    PARAM_PROPORTIONAL_Q8 = 10,
    PARAM_INTEGRAL_Q12 = 11,
    PARAM_INTEGRAL_LIMIT = 12,
    PARAM_BATTERY_FULL_MV = 13,
    PARAM_BATTERY_MIN_MV = 14,
};

// X(name, default, lowest, highest) for every parameter, in the order of enum param.
#define PARAM_LIST(X) \
    X(UM_PER_COUNT_LEFT, 5000, 100, 40000) /* travel of the left wheel's rim in one count, um */ \
    X(UM_PER_COUNT_RIGHT, 5000, 100, 40000) /* the same, right wheel */ \
    X(TRACK_UM, 150000, 20000, 1000000) /* between the wheels' contact points, um */ \
    X(SPEED_MAX_MM_S, 600, 20, 2000) /* fastest a wheel may be asked to go, mm/s */ \
    X(ACCELERATION_MM_S2, 1000, 50, 10000) /* most a wheel's speed is made to change, mm/s^2 */ \
    X(STATIC_DUTY_LEFT, 2600, 0, 32767) /* duty that just overcomes friction, 32767 = full */ \
    X(STATIC_DUTY_RIGHT, 2600, 0, 32767) /* the same, right motor */ \
    X(VELOCITY_Q8_LEFT, 690, 0, 32767) /* duty per 1/16 mm/s of speed, times 256, left motor */ \
    X(VELOCITY_Q8_RIGHT, 690, 0, 32767) /* the same, right motor */ \
    X(ACCELERATION_Q8, 0, 0, 32767) /* duty per 1/16 mm/s of speed gained in a tick, times 256 */ \
    X(PROPORTIONAL_Q8, 345, 0, 32767) /* duty per 1/16 mm/s of error, times 256 */ \
    X(INTEGRAL_Q12, 140, 0, 32767) /* duty per 1/16 mm/s of error and tick, times 4096 */ \
    X(INTEGRAL_LIMIT, 8000, 0, 32767) /* duty the integral alone may reach */ \
    X(BATTERY_FULL_MV, 7400, 1000, 30000) /* voltage at which the duties above hold, mV */ \
    X(BATTERY_MIN_MV, 6400, 0, 30000) /* less for 0.5 s stops the robot, mV; 0: not watched */

#define PARAM_COUNT 15u

// --- Bytes ---------------------------------------------------------------------------------------

static inline void msg_put_u8(uint8_t *at, uint8_t value)
{
    at[0] = value;
}

static inline void msg_put_u16(uint8_t *at, uint16_t value)
{
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

static inline void msg_put_u32(uint8_t *at, uint32_t value)
{
    msg_put_u16(at, (uint16_t)value);
    msg_put_u16(at + 2, (uint16_t)(value >> 16));
}

static inline uint8_t msg_get_u8(const uint8_t *at)
{
    return at[0];
}

static inline uint16_t msg_get_u16(const uint8_t *at)
{
    return (uint16_t)(at[0] | (uint16_t)at[1] << 8);
}

static inline uint32_t msg_get_u32(const uint8_t *at)
{
    return msg_get_u16(at) | (uint32_t)msg_get_u16(at + 2) << 16;
}

// --- Messages to the robot -------------------------------------------------------------------------

// Opens a session; the robot answers HELLO, and NACK besides when the schemas differ.
#define MSG_HELLO_REQUEST 0x01u
#define MSG_HELLO_REQUEST_SIZE 5u

struct msg_hello_request {
    uint8_t protocol_version; // the host's PROTOCOL_VERSION
    uint32_t schema_hash;     // the host's SCHEMA_HASH
};

static inline void msg_hello_request_encode(const struct msg_hello_request *message, uint8_t *payload)
{
    msg_put_u8(payload + 0, message->protocol_version);
    msg_put_u32(payload + 1, message->schema_hash);
}

static inline void msg_hello_request_decode(struct msg_hello_request *message, const uint8_t *payload)
{
    message->protocol_version = msg_get_u8(payload + 0);
    message->schema_hash = msg_get_u32(payload + 1);
}

// Asks for PONG: the robot's clock, and whether anybody is there.
#define MSG_PING 0x02u
#define MSG_PING_SIZE 4u

struct msg_ping {
    uint32_t host_time_us; // any number; comes back in PONG
};

static inline void msg_ping_encode(const struct msg_ping *message, uint8_t *payload)
{
    msg_put_u32(payload + 0, message->host_time_us);
}

static inline void msg_ping_decode(struct msg_ping *message, const uint8_t *payload)
{
    message->host_time_us = msg_get_u32(payload + 0);
}

// A setpoint; the latest wins, and it dies at its deadline.
#define MSG_DRIVE 0x03u
#define MSG_DRIVE_SIZE 8u

struct msg_drive {
    int16_t v_mm_s;       // forward speed
    int16_t omega_mrad_s; // turn rate, positive to the right
    uint32_t expires_us;  // robot's clock at which the setpoint dies; at most 200 ms hold
};

static inline void msg_drive_encode(const struct msg_drive *message, uint8_t *payload)
{
    msg_put_u16(payload + 0, (uint16_t)message->v_mm_s);
    msg_put_u16(payload + 2, (uint16_t)message->omega_mrad_s);
    msg_put_u32(payload + 4, message->expires_us);
}

static inline void msg_drive_decode(struct msg_drive *message, const uint8_t *payload)
{
    message->v_mm_s = (int16_t)msg_get_u16(payload + 0);
    message->omega_mrad_s = (int16_t)msg_get_u16(payload + 2);
    message->expires_us = msg_get_u32(payload + 4);
}

// Motors off without a fault: brake to a standstill, or coast.
#define MSG_STOP 0x04u
#define MSG_STOP_SIZE 1u

struct msg_stop {
    uint8_t how; // StopHow; what is not one of these brakes
};

static inline void msg_stop_encode(const struct msg_stop *message, uint8_t *payload)
{
    msg_put_u8(payload + 0, message->how);
}

static inline void msg_stop_decode(struct msg_stop *message, const uint8_t *payload)
{
    message->how = msg_get_u8(payload + 0);
}

// Motors off at once, in any state and any order; latched until CLEAR.
#define MSG_ESTOP 0x05u
#define MSG_ESTOP_SIZE 0u

// Unlatch the fault; the nonce proves that this start of the robot is meant.
#define MSG_CLEAR 0x06u
#define MSG_CLEAR_SIZE 4u

struct msg_clear {
    uint32_t boot_nonce; // from HELLO or TELEMETRY
};

static inline void msg_clear_encode(const struct msg_clear *message, uint8_t *payload)
{
    msg_put_u32(payload + 0, message->boot_nonce);
}

static inline void msg_clear_decode(struct msg_clear *message, const uint8_t *payload)
{
    message->boot_nonce = msg_get_u32(payload + 0);
}

// Drive straight for a distance, heading held. A request: done exactly once.
#define MSG_MOVE 0x07u
#define MSG_MOVE_SIZE 14u

struct msg_move {
    uint32_t boot_nonce; // from HELLO or TELEMETRY
    uint16_t request;    // one more than the `request` of TELEMETRY
    int16_t distance_mm; // forward positive
    uint16_t speed_mm_s; // fastest on the way, above 0
    uint32_t expires_us; // robot's clock at which it ends unless KEEP_ALIVE comes
};

static inline void msg_move_encode(const struct msg_move *message, uint8_t *payload)
{
    msg_put_u32(payload + 0, message->boot_nonce);
    msg_put_u16(payload + 4, message->request);
    msg_put_u16(payload + 6, (uint16_t)message->distance_mm);
    msg_put_u16(payload + 8, message->speed_mm_s);
    msg_put_u32(payload + 10, message->expires_us);
}

static inline void msg_move_decode(struct msg_move *message, const uint8_t *payload)
{
    message->boot_nonce = msg_get_u32(payload + 0);
    message->request = msg_get_u16(payload + 4);
    message->distance_mm = (int16_t)msg_get_u16(payload + 6);
    message->speed_mm_s = msg_get_u16(payload + 8);
    message->expires_us = msg_get_u32(payload + 10);
}

// Turn on the spot by an angle. A request: done exactly once.
#define MSG_TURN 0x08u
#define MSG_TURN_SIZE 14u

struct msg_turn {
    uint32_t boot_nonce;  // from HELLO or TELEMETRY
    uint16_t request;     // one more than the `request` of TELEMETRY
    int16_t angle_mrad;   // positive to the right
    uint16_t rate_mrad_s; // fastest on the way, above 0
    uint32_t expires_us;  // robot's clock at which it ends unless KEEP_ALIVE comes
};

static inline void msg_turn_encode(const struct msg_turn *message, uint8_t *payload)
{
    msg_put_u32(payload + 0, message->boot_nonce);
    msg_put_u16(payload + 4, message->request);
    msg_put_u16(payload + 6, (uint16_t)message->angle_mrad);
    msg_put_u16(payload + 8, message->rate_mrad_s);
    msg_put_u32(payload + 10, message->expires_us);
}

static inline void msg_turn_decode(struct msg_turn *message, const uint8_t *payload)
{
    message->boot_nonce = msg_get_u32(payload + 0);
    message->request = msg_get_u16(payload + 4);
    message->angle_mrad = (int16_t)msg_get_u16(payload + 6);
    message->rate_mrad_s = msg_get_u16(payload + 8);
    message->expires_us = msg_get_u32(payload + 10);
}

// Lets a move go on; the latest wins.
#define MSG_KEEP_ALIVE 0x09u
#define MSG_KEEP_ALIVE_SIZE 4u

struct msg_keep_alive {
    uint32_t expires_us; // robot's clock at which the move brakes; at most 200 ms hold
};

static inline void msg_keep_alive_encode(const struct msg_keep_alive *message, uint8_t *payload)
{
    msg_put_u32(payload + 0, message->expires_us);
}

static inline void msg_keep_alive_decode(struct msg_keep_alive *message, const uint8_t *payload)
{
    message->expires_us = msg_get_u32(payload + 0);
}

// Asks for PARAM_VALUE.
#define MSG_PARAM_READ 0x0Au
#define MSG_PARAM_READ_SIZE 1u

struct msg_param_read {
    uint8_t param; // a Param
};

static inline void msg_param_read_encode(const struct msg_param_read *message, uint8_t *payload)
{
    msg_put_u8(payload + 0, message->param);
}

static inline void msg_param_read_decode(struct msg_param_read *message, const uint8_t *payload)
{
    message->param = msg_get_u8(payload + 0);
}

// Set a parameter until the next start. A request: done exactly once, answered by PARAM_VALUE.
#define MSG_PARAM_WRITE 0x0Bu
#define MSG_PARAM_WRITE_SIZE 11u

struct msg_param_write {
    uint32_t boot_nonce; // from HELLO or TELEMETRY
    uint16_t request;    // one more than the `request` of TELEMETRY
    uint8_t param;       // a Param
    int32_t value;       // within the parameter's range
};

static inline void msg_param_write_encode(const struct msg_param_write *message, uint8_t *payload)
{
    msg_put_u32(payload + 0, message->boot_nonce);
    msg_put_u16(payload + 4, message->request);
    msg_put_u8(payload + 6, message->param);
    msg_put_u32(payload + 7, (uint32_t)message->value);
}

static inline void msg_param_write_decode(struct msg_param_write *message, const uint8_t *payload)
{
    message->boot_nonce = msg_get_u32(payload + 0);
    message->request = msg_get_u16(payload + 4);
    message->param = msg_get_u8(payload + 6);
    message->value = (int32_t)msg_get_u32(payload + 7);
}

// Keep all parameters as they are in EEPROM. A request: done exactly once.
#define MSG_PARAM_SAVE 0x0Cu
#define MSG_PARAM_SAVE_SIZE 6u

struct msg_param_save {
    uint32_t boot_nonce; // from HELLO or TELEMETRY
    uint16_t request;    // one more than the `request` of TELEMETRY
};

static inline void msg_param_save_encode(const struct msg_param_save *message, uint8_t *payload)
{
    msg_put_u32(payload + 0, message->boot_nonce);
    msg_put_u16(payload + 4, message->request);
}

static inline void msg_param_save_decode(struct msg_param_save *message, const uint8_t *payload)
{
    message->boot_nonce = msg_get_u32(payload + 0);
    message->request = msg_get_u16(payload + 4);
}

#define MSG_UNKNOWN 0xFFu

// Payload size of a message to the robot; MSG_UNKNOWN when no such message has this id.
static inline uint8_t msg_to_robot_size(uint8_t id)
{
    switch (id) {
    case MSG_HELLO_REQUEST: return MSG_HELLO_REQUEST_SIZE;
    case MSG_PING: return MSG_PING_SIZE;
    case MSG_DRIVE: return MSG_DRIVE_SIZE;
    case MSG_STOP: return MSG_STOP_SIZE;
    case MSG_ESTOP: return MSG_ESTOP_SIZE;
    case MSG_CLEAR: return MSG_CLEAR_SIZE;
    case MSG_MOVE: return MSG_MOVE_SIZE;
    case MSG_TURN: return MSG_TURN_SIZE;
    case MSG_KEEP_ALIVE: return MSG_KEEP_ALIVE_SIZE;
    case MSG_PARAM_READ: return MSG_PARAM_READ_SIZE;
    case MSG_PARAM_WRITE: return MSG_PARAM_WRITE_SIZE;
    case MSG_PARAM_SAVE: return MSG_PARAM_SAVE_SIZE;
    default: return MSG_UNKNOWN;
    }
}

// --- Messages to the host --------------------------------------------------------------------------

// Who the robot is: answers HELLO_REQUEST, and is sent once unasked after every start.
#define MSG_HELLO 0x81u
#define MSG_HELLO_SIZE 14u

struct msg_hello {
    uint8_t protocol_version; // the robot's PROTOCOL_VERSION
    uint32_t schema_hash;     // the robot's SCHEMA_HASH
    uint32_t build_id;        // of the firmware
    uint8_t reset_cause;      // why the robot last started
    uint32_t boot_nonce;      // another number after every start
};

static inline void msg_hello_encode(const struct msg_hello *message, uint8_t *payload)
{
    msg_put_u8(payload + 0, message->protocol_version);
    msg_put_u32(payload + 1, message->schema_hash);
    msg_put_u32(payload + 5, message->build_id);
    msg_put_u8(payload + 9, message->reset_cause);
    msg_put_u32(payload + 10, message->boot_nonce);
}

static inline void msg_hello_decode(struct msg_hello *message, const uint8_t *payload)
{
    message->protocol_version = msg_get_u8(payload + 0);
    message->schema_hash = msg_get_u32(payload + 1);
    message->build_id = msg_get_u32(payload + 5);
    message->reset_cause = msg_get_u8(payload + 9);
    message->boot_nonce = msg_get_u32(payload + 10);
}

// Answers PING.
#define MSG_PONG 0x82u
#define MSG_PONG_SIZE 8u

struct msg_pong {
    uint32_t host_time_us; // from PING
    uint32_t mcu_time_us;  // robot's clock when PING was handled
};

static inline void msg_pong_encode(const struct msg_pong *message, uint8_t *payload)
{
    msg_put_u32(payload + 0, message->host_time_us);
    msg_put_u32(payload + 4, message->mcu_time_us);
}

static inline void msg_pong_decode(struct msg_pong *message, const uint8_t *payload)
{
    message->host_time_us = msg_get_u32(payload + 0);
    message->mcu_time_us = msg_get_u32(payload + 4);
}

// The robot's state, every 10 ms.
#define MSG_TELEMETRY 0x83u
#define MSG_TELEMETRY_SIZE 47u

struct msg_telemetry {
    uint32_t mcu_time_us;        // robot's clock at which everything below held
    uint8_t state;               // what the supervisor allows
    uint8_t fault;               // why not
    int32_t count_left;          // left encoder, counts since boot, forward positive
    int32_t count_right;         // right encoder, counts since boot, forward positive
    uint32_t edge_age_left_us;   // since the left encoder's last edge; 2^32-1: none, or over 2^31
    uint32_t edge_age_right_us;  // since the right encoder's last edge; 2^32-1: none, or over 2^31
    int16_t speed_left_mm_s;     // left wheel, as estimated by the control loop
    int16_t speed_right_mm_s;    // right wheel, as estimated by the control loop
    int16_t duty_left_permille;  // left motor, -1000 to 1000
    int16_t duty_right_permille; // right motor, -1000 to 1000
    uint16_t battery_mv;         // 0: not measured
    uint16_t illegal_left;       // impossible transitions of the left encoder, wraps
    uint16_t illegal_right;      // impossible transitions of the right encoder, wraps
    uint32_t boot_nonce;         // as in HELLO; a change means that the robot restarted
    uint8_t drive_seq;           // sequence number of the last DRIVE obeyed
    int8_t direction_left;       // of the left encoder's last edge: 1 forward, -1 backward, 0: none
    int8_t direction_right;      // of the right encoder's last edge: 1 forward, -1 backward, 0: none
    uint16_t request;            // the last request taken, 0 before the first
    uint8_t outcome;             // what became of it
    uint8_t reason;              // why it was refused or ended early
};

static inline void msg_telemetry_encode(const struct msg_telemetry *message, uint8_t *payload)
{
    msg_put_u32(payload + 0, message->mcu_time_us);
    msg_put_u8(payload + 4, message->state);
    msg_put_u8(payload + 5, message->fault);
    msg_put_u32(payload + 6, (uint32_t)message->count_left);
    msg_put_u32(payload + 10, (uint32_t)message->count_right);
    msg_put_u32(payload + 14, message->edge_age_left_us);
    msg_put_u32(payload + 18, message->edge_age_right_us);
    msg_put_u16(payload + 22, (uint16_t)message->speed_left_mm_s);
    msg_put_u16(payload + 24, (uint16_t)message->speed_right_mm_s);
    msg_put_u16(payload + 26, (uint16_t)message->duty_left_permille);
    msg_put_u16(payload + 28, (uint16_t)message->duty_right_permille);
    msg_put_u16(payload + 30, message->battery_mv);
    msg_put_u16(payload + 32, message->illegal_left);
    msg_put_u16(payload + 34, message->illegal_right);
    msg_put_u32(payload + 36, message->boot_nonce);
    msg_put_u8(payload + 40, message->drive_seq);
    msg_put_u8(payload + 41, (uint8_t)message->direction_left);
    msg_put_u8(payload + 42, (uint8_t)message->direction_right);
    msg_put_u16(payload + 43, message->request);
    msg_put_u8(payload + 45, message->outcome);
    msg_put_u8(payload + 46, message->reason);
}

static inline void msg_telemetry_decode(struct msg_telemetry *message, const uint8_t *payload)
{
    message->mcu_time_us = msg_get_u32(payload + 0);
    message->state = msg_get_u8(payload + 4);
    message->fault = msg_get_u8(payload + 5);
    message->count_left = (int32_t)msg_get_u32(payload + 6);
    message->count_right = (int32_t)msg_get_u32(payload + 10);
    message->edge_age_left_us = msg_get_u32(payload + 14);
    message->edge_age_right_us = msg_get_u32(payload + 18);
    message->speed_left_mm_s = (int16_t)msg_get_u16(payload + 22);
    message->speed_right_mm_s = (int16_t)msg_get_u16(payload + 24);
    message->duty_left_permille = (int16_t)msg_get_u16(payload + 26);
    message->duty_right_permille = (int16_t)msg_get_u16(payload + 28);
    message->battery_mv = msg_get_u16(payload + 30);
    message->illegal_left = msg_get_u16(payload + 32);
    message->illegal_right = msg_get_u16(payload + 34);
    message->boot_nonce = msg_get_u32(payload + 36);
    message->drive_seq = msg_get_u8(payload + 40);
    message->direction_left = (int8_t)msg_get_u8(payload + 41);
    message->direction_right = (int8_t)msg_get_u8(payload + 42);
    message->request = msg_get_u16(payload + 43);
    message->outcome = msg_get_u8(payload + 45);
    message->reason = msg_get_u8(payload + 46);
}

// A message arrived whole and was not obeyed.
#define MSG_NACK 0x84u
#define MSG_NACK_SIZE 3u

struct msg_nack {
    uint8_t message; // id of the message refused
    uint8_t seq;     // its sequence number
    uint8_t reason;  // why
};

static inline void msg_nack_encode(const struct msg_nack *message, uint8_t *payload)
{
    msg_put_u8(payload + 0, message->message);
    msg_put_u8(payload + 1, message->seq);
    msg_put_u8(payload + 2, message->reason);
}

static inline void msg_nack_decode(struct msg_nack *message, const uint8_t *payload)
{
    message->message = msg_get_u8(payload + 0);
    message->seq = msg_get_u8(payload + 1);
    message->reason = msg_get_u8(payload + 2);
}

// What the robot's end of the link saw, every 200 ms; counts since boot, each wraps.
#define MSG_LINK_STATUS 0x85u
#define MSG_LINK_STATUS_SIZE 20u

struct msg_link_status {
    uint16_t frames;     // received whole and correct
    uint16_t crc;        // frames dropped: checksum wrong
    uint16_t framing;    // frames dropped: COBS broken, or too short to be a frame
    uint16_t overlong;   // frames dropped: longer than any message
    uint16_t unknown;    // frames dropped: no message has this id
    uint16_t length;     // frames dropped: wrong length for the message
    uint16_t lost;       // messages that never came, by the gaps in the sequence numbers
    uint16_t stale;      // frames dropped: repeated, or overtaken by a later one
    uint16_t tx_dropped; // messages not sent for want of room
    uint16_t rx_overrun; // bytes lost before the decoder saw them
};

static inline void msg_link_status_encode(const struct msg_link_status *message, uint8_t *payload)
{
    msg_put_u16(payload + 0, message->frames);
    msg_put_u16(payload + 2, message->crc);
    msg_put_u16(payload + 4, message->framing);
    msg_put_u16(payload + 6, message->overlong);
    msg_put_u16(payload + 8, message->unknown);
    msg_put_u16(payload + 10, message->length);
    msg_put_u16(payload + 12, message->lost);
    msg_put_u16(payload + 14, message->stale);
    msg_put_u16(payload + 16, message->tx_dropped);
    msg_put_u16(payload + 18, message->rx_overrun);
}

static inline void msg_link_status_decode(struct msg_link_status *message, const uint8_t *payload)
{
    message->frames = msg_get_u16(payload + 0);
    message->crc = msg_get_u16(payload + 2);
    message->framing = msg_get_u16(payload + 4);
    message->overlong = msg_get_u16(payload + 6);
    message->unknown = msg_get_u16(payload + 8);
    message->length = msg_get_u16(payload + 10);
    message->lost = msg_get_u16(payload + 12);
    message->stale = msg_get_u16(payload + 14);
    message->tx_dropped = msg_get_u16(payload + 16);
    message->rx_overrun = msg_get_u16(payload + 18);
}

// Answers PARAM_READ and PARAM_WRITE.
#define MSG_PARAM_VALUE 0x86u
#define MSG_PARAM_VALUE_SIZE 5u

struct msg_param_value {
    uint8_t param; // which parameter
    int32_t value; // as it is now
};

static inline void msg_param_value_encode(const struct msg_param_value *message, uint8_t *payload)
{
    msg_put_u8(payload + 0, message->param);
    msg_put_u32(payload + 1, (uint32_t)message->value);
}

static inline void msg_param_value_decode(struct msg_param_value *message, const uint8_t *payload)
{
    message->param = msg_get_u8(payload + 0);
    message->value = (int32_t)msg_get_u32(payload + 1);
}

#endif
