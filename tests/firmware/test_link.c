// Specification of link.c: what is handed on, what is dropped and counted, what is sent.
#include <setjmp.h> // cmocka
#include <stdarg.h> // cmocka
#include <stddef.h> // cmocka
#include <stdint.h> // cmocka

#include <cmocka.h> // the test framework
#include <string.h> // memcpy, memset

#include "host_coded.h"  // frames of raw bytes
#include "host_frames.h" // frames of messages
#include "link.h"        // what is specified here

// --- A link whose handler and wire are arrays ------------------------------------------------------

struct received {
    uint8_t id;
    uint8_t seq;
    uint8_t payload[LINK_RAW_MAX_TO_ROBOT];
};

static struct {
    struct link link;
    struct received received[600];
    unsigned received_count;
    uint8_t wire[LINK_WIRE_MAX];
    unsigned wire_size;
} rig;

static void handle(void *context, uint8_t id, uint8_t seq, const uint8_t *payload)
{
    assert_ptr_equal(context, &rig);
    struct received *received = &rig.received[rig.received_count++];
    received->id = id;
    received->seq = seq;
    memcpy(received->payload, payload, msg_to_robot_size(id));
}

static void sink(void *context, uint8_t byte)
{
    assert_ptr_equal(context, &rig);
    assert_true(rig.wire_size < sizeof rig.wire);
    rig.wire[rig.wire_size++] = byte;
}

static int fresh(void **state)
{
    (void)state;
    memset(&rig, 0, sizeof rig);
    link_init(&rig.link, handle, sink, &rig);
    return 0;
}

static void receive(const uint8_t *bytes, unsigned size)
{
    for (unsigned i = 0; i < size; i++)
        link_receive_byte(&rig.link, bytes[i]);
}

static void receive_message(uint8_t id, uint8_t seq, const uint8_t *payload, uint8_t size)
{
    uint8_t wire[80];
    receive(wire, host_frame(wire, id, seq, payload, size));
}

static void receive_stop(uint8_t seq)
{
    const uint8_t payload[MSG_STOP_SIZE] = {STOP_BRAKE};
    receive_message(MSG_STOP, seq, payload, MSG_STOP_SIZE);
}

static unsigned dropped(void)
{
    const struct msg_link_status *counters = &rig.link.counters;
    return (unsigned)(counters->crc + counters->framing + counters->overlong + counters->unknown +
                      counters->length + counters->stale);
}


// --- The checksum ----------------------------------------------------------------------------------

static void the_checksum_is_crc_32c(void **state)
{
    (void)state;
    assert_int_equal(link_crc32c((const uint8_t *)"123456789", 9), 0xE3069283);
    assert_int_equal(link_crc32c(NULL, 0), 0);
    const uint8_t zeros[32] = {0};
    assert_int_equal(link_crc32c(zeros, 32), 0x8A9136AA); // RFC 3720, B.4
}

// --- What is handed on -----------------------------------------------------------------------------

static void a_whole_frame_is_handed_on_once_and_at_its_delimiter(void **state)
{
    (void)state;
    const struct msg_drive sent = {.v_mm_s = -300, .omega_mrad_s = 1234, .expires_us = 0xFEDC0098};
    uint8_t payload[MSG_DRIVE_SIZE], wire[80];
    msg_drive_encode(&sent, payload);
    unsigned size = host_frame(wire, MSG_DRIVE, 200, payload, MSG_DRIVE_SIZE);
    receive(wire, size - 1);
    assert_int_equal(rig.received_count, 0);
    receive(wire + size - 1, 1);
    assert_int_equal(rig.received_count, 1);
    assert_int_equal(rig.received[0].id, MSG_DRIVE);
    assert_int_equal(rig.received[0].seq, 200);
    struct msg_drive received;
    msg_drive_decode(&received, rig.received[0].payload);
    assert_int_equal(received.v_mm_s, -300);
    assert_int_equal(received.omega_mrad_s, 1234);
    assert_int_equal(received.expires_us, 0xFEDC0098);
    assert_int_equal(rig.link.counters.frames, 1);
    assert_int_equal(dropped(), 0);
}

static void every_message_to_the_robot_is_known(void **state)
{
    (void)state;
    const uint8_t ids[] = {MSG_HELLO_REQUEST, MSG_PING, MSG_DRIVE, MSG_STOP,        MSG_ESTOP,      MSG_CLEAR,
                           MSG_MOVE,          MSG_TURN, MSG_KEEP_ALIVE, MSG_PARAM_READ, MSG_PARAM_WRITE, MSG_PARAM_SAVE};
    const uint8_t payload[16] = {1, 2, 3};
    for (unsigned i = 0; i < sizeof ids; i++) {
        receive_message(ids[i], (uint8_t)i, payload, msg_to_robot_size(ids[i]));
        assert_int_equal(rig.received_count, i + 1);
        assert_int_equal(rig.received[i].id, ids[i]);
    }
}

static void empty_frames_are_idle_line_and_no_error(void **state)
{
    (void)state;
    const uint8_t zeros[20] = {0};
    receive(zeros, sizeof zeros);
    receive_stop(0);
    assert_int_equal(rig.received_count, 1);
    assert_int_equal(dropped(), 0);
}

// --- What is dropped -------------------------------------------------------------------------------

static void a_wrong_checksum_is_dropped_and_counted(void **state)
{
    (void)state;
    uint8_t wire[80];
    unsigned size = host_frame(wire, MSG_CLEAR, 1, (const uint8_t[]){1, 2, 3, 4}, 4);
    wire[4] ^= 0x10;
    receive(wire, size);
    assert_int_equal(rig.received_count, 0);
    assert_int_equal(rig.link.counters.crc, 1);
}

static void a_flipped_bit_never_makes_another_message(void **state)
{
    (void)state;
    uint8_t wire[80];
    unsigned size = host_frame(wire, MSG_DRIVE, 1, (const uint8_t[]){0, 1, 0, 0, 0, 0, 9, 0}, 8);
    for (unsigned bit = 0; bit < 8 * size; bit++) {
        wire[bit / 8] ^= (uint8_t)(1u << bit % 8);
        receive(wire, size);
        wire[bit / 8] ^= (uint8_t)(1u << bit % 8);
        link_receive_byte(&rig.link, 0); // in case the flip hit the delimiter
        assert_int_equal(rig.received_count, 0);
    }
}

static void a_frame_cut_short_is_dropped_and_the_next_one_is_whole(void **state)
{
    (void)state;
    uint8_t wire[80];
    unsigned size = host_frame(wire, MSG_PING, 1, (const uint8_t[]){1, 2, 3, 4}, 4);
    for (unsigned kept = 1; kept < size - 1; kept++) {
        fresh(NULL);
        receive(wire, kept);
        link_receive_byte(&rig.link, 0);
        assert_int_equal(rig.received_count, 0);
        assert_int_equal(dropped(), 1);
        receive(wire, size);
        assert_int_equal(rig.received_count, 1);
    }
}

static void fewer_bytes_than_id_sequence_number_and_checksum_are_a_framing_error(void **state)
{
    (void)state;
    for (unsigned size = 0; size < LINK_OVERHEAD; size++) {
        const uint8_t raw[LINK_OVERHEAD] = {1, 1, 1, 1, 1, 1};
        uint8_t wire[16];
        receive(wire, host_coded(wire, raw, size));
        assert_int_equal(rig.link.counters.framing, size + 1);
    }
    assert_int_equal(rig.received_count, 0);
}

static void an_overlong_frame_is_dropped_whatever_its_length(void **state)
{
    (void)state;
    for (unsigned n = 0; n < 100000; n++)
        link_receive_byte(&rig.link, (uint8_t)(1 + n % 255));
    link_receive_byte(&rig.link, 0);
    assert_int_equal(rig.link.counters.overlong, 1);
    assert_int_equal(dropped(), 1);
    receive_stop(0);
    assert_int_equal(rig.received_count, 1);
}

static void a_correct_frame_one_byte_longer_than_any_message_is_overlong(void **state)
{
    (void)state;
    const uint8_t payload[MSG_MOVE_SIZE + 1] = {0};
    receive_message(MSG_MOVE, 0, payload, MSG_MOVE_SIZE + 1);
    assert_int_equal(rig.link.counters.overlong, 1);
    assert_int_equal(rig.received_count, 0);
}

static void a_message_of_another_length_is_dropped_though_its_checksum_is_right(void **state)
{
    (void)state;
    const uint8_t payload[MSG_DRIVE_SIZE] = {0};
    for (uint8_t size = 0; size <= MSG_DRIVE_SIZE; size++)
        if (size != MSG_CLEAR_SIZE)
            receive_message(MSG_CLEAR, size, payload, size);
    assert_int_equal(rig.received_count, 0);
    assert_int_equal(rig.link.counters.length, MSG_DRIVE_SIZE);
}

static void an_unknown_id_is_dropped_and_so_is_one_that_only_a_host_receives(void **state)
{
    (void)state;
    const uint8_t payload[8] = {0};
    receive_message(0x00, 0, payload, 4);
    receive_message(0x7F, 1, payload, 4);
    receive_message(MSG_PONG, 2, payload, MSG_PONG_SIZE);
    assert_int_equal(rig.received_count, 0);
    assert_int_equal(rig.link.counters.unknown, 3);
}

static void random_bytes_never_reach_the_handler(void **state)
{
    (void)state;
    uint32_t random = 1;
    for (unsigned n = 0; n < 2000000; n++) {
        random = random * 1664525u + 1013904223u;
        link_receive_byte(&rig.link, (uint8_t)(random >> 24 & (n % 3000 < 1500 ? 0x07 : 0xFF)));
    }
    assert_int_equal(rig.received_count, 0);
    assert_true(dropped() > 1000);
}

// --- Order -----------------------------------------------------------------------------------------

static void gaps_in_the_sequence_are_counted_as_lost_messages(void **state)
{
    (void)state;
    receive_stop(250);
    receive_stop(251);
    assert_int_equal(rig.link.counters.lost, 0);
    receive_stop(253); // without 252
    assert_int_equal(rig.link.counters.lost, 1);
    receive_stop(3); // without 254, 255, 0, 1, 2
    assert_int_equal(rig.link.counters.lost, 6);
    assert_int_equal(rig.received_count, 4);
}

static void a_repeated_or_overtaken_frame_is_not_acted_on(void **state)
{
    (void)state;
    receive_stop(40);
    receive_stop(40);
    receive_stop(39);
    receive_stop(40 - LINK_STALE_WINDOW + 1);
    assert_int_equal(rig.received_count, 1);
    assert_int_equal(rig.link.counters.stale, 3);
    receive_stop(41);
    assert_int_equal(rig.received_count, 2);
    assert_int_equal(rig.link.counters.lost, 0);
}

static void after_a_long_silence_of_one_direction_the_link_goes_on(void **state)
{
    (void)state;
    receive_stop(40);
    receive_stop(40 - LINK_STALE_WINDOW); // 239 messages later, as far as anyone can tell
    assert_int_equal(rig.received_count, 2);
    assert_int_equal(rig.link.counters.lost, 239);
}

static void an_emergency_stop_is_honoured_in_any_order(void **state)
{
    (void)state;
    receive_stop(40);
    receive_message(MSG_ESTOP, 40, NULL, 0);
    receive_message(MSG_ESTOP, 30, NULL, 0);
    assert_int_equal(rig.received_count, 3);
    assert_int_equal(rig.received[1].id, MSG_ESTOP);
    assert_int_equal(rig.received[2].id, MSG_ESTOP);
    assert_int_equal(rig.link.seq_newest, 40); // and leaves the order alone
}

static void a_hello_request_starts_a_new_sequence(void **state)
{
    (void)state;
    const uint8_t payload[MSG_HELLO_REQUEST_SIZE] = {0};
    receive_stop(40);
    receive_message(MSG_HELLO_REQUEST, 35, payload, MSG_HELLO_REQUEST_SIZE);
    receive_stop(36);
    assert_int_equal(rig.received_count, 3);
    assert_int_equal(rig.link.counters.lost, 0);
    assert_int_equal(rig.link.counters.stale, 0);
}

// --- Sending ---------------------------------------------------------------------------------------

static void what_is_sent_is_a_frame_and_its_sequence_numbers_follow_one_another(void **state)
{
    (void)state;
    struct msg_pong pong = {.host_time_us = 0, .mcu_time_us = 0x01000200};
    uint8_t payload[MSG_PONG_SIZE], expected[80];
    msg_pong_encode(&pong, payload);
    for (unsigned n = 0; n < 300; n++) {
        rig.wire_size = 0;
        assert_true(link_send(&rig.link, MSG_PONG, payload, MSG_PONG_SIZE, LINK_WIRE_MAX));
        unsigned size = host_frame(expected, MSG_PONG, (uint8_t)n, payload, MSG_PONG_SIZE);
        assert_int_equal(rig.wire_size, size);
        assert_memory_equal(rig.wire, expected, size);
    }
}

static void a_message_without_payload_is_sent_as_any_other(void **state)
{
    (void)state;
    uint8_t expected[80];
    assert_true(link_send(&rig.link, 0x90, NULL, 0, LINK_WIRE_MAX));
    unsigned size = host_frame(expected, 0x90, 0, NULL, 0);
    assert_int_equal(rig.wire_size, size);
    assert_memory_equal(rig.wire, expected, size);
}

static void the_longest_message_fits_the_room_promised(void **state)
{
    (void)state;
    uint8_t payload[LINK_RAW_MAX_TO_HOST - LINK_OVERHEAD];
    memset(payload, 0xA5, sizeof payload);
    assert_true(link_send(&rig.link, MSG_TELEMETRY, payload, sizeof payload, LINK_WIRE_MAX));
    assert_int_equal(rig.wire_size, LINK_WIRE_MAX);
}

static void a_message_without_room_is_not_begun_and_leaves_a_gap(void **state)
{
    (void)state;
    const uint8_t payload[MSG_PONG_SIZE] = {0};
    const uint16_t needed = MSG_PONG_SIZE + LINK_OVERHEAD + 2;
    assert_false(link_send(&rig.link, MSG_PONG, payload, MSG_PONG_SIZE, (uint16_t)(needed - 1)));
    assert_int_equal(rig.wire_size, 0);
    assert_int_equal(rig.link.counters.tx_dropped, 1);
    assert_true(link_send(&rig.link, MSG_PONG, payload, MSG_PONG_SIZE, needed));
    assert_int_equal(rig.wire_size, needed);
    assert_int_equal(rig.link.seq_next, 2);
}

static void a_message_longer_than_any_of_the_schema_is_refused(void **state)
{
    (void)state;
    const uint8_t payload[LINK_RAW_MAX_TO_HOST] = {0};
    assert_false(link_send(&rig.link, MSG_TELEMETRY, payload, MSG_TELEMETRY_SIZE + 1, 1000));
    assert_int_equal(rig.wire_size, 0);
    assert_int_equal(rig.link.counters.tx_dropped, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(the_checksum_is_crc_32c, fresh),
        cmocka_unit_test_setup(a_whole_frame_is_handed_on_once_and_at_its_delimiter, fresh),
        cmocka_unit_test_setup(every_message_to_the_robot_is_known, fresh),
        cmocka_unit_test_setup(empty_frames_are_idle_line_and_no_error, fresh),
        cmocka_unit_test_setup(a_wrong_checksum_is_dropped_and_counted, fresh),
        cmocka_unit_test_setup(a_flipped_bit_never_makes_another_message, fresh),
        cmocka_unit_test_setup(a_frame_cut_short_is_dropped_and_the_next_one_is_whole, fresh),
        cmocka_unit_test_setup(fewer_bytes_than_id_sequence_number_and_checksum_are_a_framing_error, fresh),
        cmocka_unit_test_setup(an_overlong_frame_is_dropped_whatever_its_length, fresh),
        cmocka_unit_test_setup(a_correct_frame_one_byte_longer_than_any_message_is_overlong, fresh),
        cmocka_unit_test_setup(a_message_of_another_length_is_dropped_though_its_checksum_is_right, fresh),
        cmocka_unit_test_setup(an_unknown_id_is_dropped_and_so_is_one_that_only_a_host_receives, fresh),
        cmocka_unit_test_setup(random_bytes_never_reach_the_handler, fresh),
        cmocka_unit_test_setup(gaps_in_the_sequence_are_counted_as_lost_messages, fresh),
        cmocka_unit_test_setup(a_repeated_or_overtaken_frame_is_not_acted_on, fresh),
        cmocka_unit_test_setup(after_a_long_silence_of_one_direction_the_link_goes_on, fresh),
        cmocka_unit_test_setup(an_emergency_stop_is_honoured_in_any_order, fresh),
        cmocka_unit_test_setup(a_hello_request_starts_a_new_sequence, fresh),
        cmocka_unit_test_setup(what_is_sent_is_a_frame_and_its_sequence_numbers_follow_one_another, fresh),
        cmocka_unit_test_setup(a_message_without_payload_is_sent_as_any_other, fresh),
        cmocka_unit_test_setup(the_longest_message_fits_the_room_promised, fresh),
        cmocka_unit_test_setup(a_message_without_room_is_not_begun_and_leaves_a_gap, fresh),
        cmocka_unit_test_setup(a_message_longer_than_any_of_the_schema_is_refused, fresh),
    };
    return cmocka_run_group_tests_name("link", tests, NULL, NULL);
}
