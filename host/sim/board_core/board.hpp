// One simulated board: the firmware's C on hardware made of queues and virtual time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <string_view>

extern "C" {
#include "robot.h"
}

// What stands where the ATmega's registers stand: the other side of hal.h.
struct hal {
    uint8_t pins[DRIVE_SIDES] = {};
    int16_t duty[DRIVE_SIDES] = {};
    bool coasting[DRIVE_SIDES] = {};
    uint16_t battery_mv = 7400;
    bool estop_pressed = false;
    uint8_t reset_cause = RESET_POWER_ON;
    uint32_t boot_nonce = 0;
    uint16_t received_lost = 0;
    std::deque<uint8_t> received;    // the receive interrupt's ring, at most receive_size
    std::deque<uint8_t> to_transmit; // the transmit ring, at most transmit_size

    std::array<uint8_t, 1024> eeprom;
    int64_t now_us = 0;
    int64_t eeprom_done_us = 0; // when the last write is

    static constexpr int64_t eeprom_write_us = 3400;
    static constexpr std::size_t receive_size = 64;
    static constexpr std::size_t transmit_size = 128;
};

// Interrupts (edges, bytes in and out) happen at their own microsecond; the main loop answers at once, unless
// it hangs. Events of one microsecond run in a fixed order, so equal calls give equal runs.
class Board {
public:
    Board(uint64_t seed, std::string_view eeprom);
    Board(const Board &) = delete; // the firmware keeps pointers into it
    Board &operator=(const Board &) = delete;

    void step(int64_t us);
    int64_t time_us() const { return now_us_; }

    // Bytes on the line to the board; each takes byte_us to get there.
    void write(std::string_view bytes);
    // Bytes that have arrived from the board.
    std::string read();

    void set_encoder_pins(uint8_t side, bool a, bool b, int64_t at_us);
    int16_t duty(uint8_t side) const { return hal_.duty[side]; }
    bool coasting(uint8_t side) const { return hal_.coasting[side]; }
    std::string_view eeprom() const
    {
        return {reinterpret_cast<const char *>(hal_.eeprom.data()), hal_.eeprom.size()};
    }
    void set_battery_mv(uint16_t mv) { hal_.battery_mv = mv; }
    void press_estop(bool pressed) { hal_.estop_pressed = pressed; }

    void reset(uint8_t cause);
    void hang(int64_t us);

    static constexpr int64_t byte_us = 40; // ten bits at 250000 baud
    static constexpr int64_t watchdog_us = 60'000; // after the last tick

private:
    struct Edge {
        int64_t at_us;
        uint8_t side;
        uint8_t pins;
    };

    static constexpr int64_t never = INT64_MAX;

    uint32_t mcu_us() const { return static_cast<uint32_t>(now_us_ - start_us_); }
    void set_now(int64_t us);
    void start();
    int64_t next_event_us() const;
    void run_events();
    void run_main_loop();

    uint64_t nonce_state_;
    hal hal_;
    robot robot_;

    int64_t now_us_ = 0;
    int64_t start_us_ = 0; // of the robot's clock
    int64_t tick_at_us_ = 0;
    int64_t hung_until_us_ = 0;
    int64_t watchdog_at_us_ = never;
    int64_t byte_in_at_us_ = never;
    int64_t byte_out_at_us_ = never;
    std::deque<Edge> edges_; // by time
    std::deque<uint8_t> to_board_;
    std::string from_board_;
};
