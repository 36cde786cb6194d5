// One simulated board: virtual time, the serial line's pace, and the answers to hal.h.
#include "board.hpp"

#include <algorithm>

// --- hal.h -----------------------------------------------------------------------------------------

extern "C" {

uint8_t hal_encoder_pins(hal *hal, uint8_t side)
{
    return hal->pins[side];
}

// Simulated interrupts never come in the middle of a call.
uint8_t hal_interrupts_off(hal *)
{
    return 0;
}

void hal_interrupts_restore(hal *, uint8_t) {}

void hal_motor_set(hal *hal, uint8_t side, int16_t duty)
{
    hal->duty[side] = duty;
    hal->coasting[side] = false;
}

void hal_motor_coast(hal *hal, uint8_t side)
{
    hal->duty[side] = 0;
    hal->coasting[side] = true;
}

uint16_t hal_uart_room(hal *hal)
{
    return static_cast<uint16_t>(hal::transmit_size - hal->to_transmit.size());
}

void hal_uart_put(hal *hal, uint8_t byte)
{
    hal->to_transmit.push_back(byte);
}

uint16_t hal_uart_lost(hal *hal)
{
    return hal->received_lost;
}

uint16_t hal_battery_mv(hal *hal)
{
    return hal->battery_mv;
}

bool hal_estop_pressed(hal *hal)
{
    return hal->estop_pressed;
}

bool hal_eeprom_busy(hal *hal)
{
    return hal->now_us < hal->eeprom_done_us;
}

uint8_t hal_eeprom_read(hal *hal, uint16_t address)
{
    return hal->eeprom[address % hal->eeprom.size()];
}

void hal_eeprom_write(hal *hal, uint16_t address, uint8_t byte)
{
    hal->eeprom[address % hal->eeprom.size()] = byte;
    hal->eeprom_done_us = hal->now_us + hal::eeprom_write_us;
}

uint8_t hal_reset_cause(hal *hal)
{
    return hal->reset_cause;
}

uint32_t hal_boot_nonce(hal *hal)
{
    return hal->boot_nonce;
}

} // extern "C"

// --- Start -----------------------------------------------------------------------------------------

Board::Board(uint64_t seed, std::string_view eeprom) : nonce_state_(seed)
{
    hal_.eeprom.fill(0xFF);
    std::copy_n(eeprom.begin(), std::min(eeprom.size(), hal_.eeprom.size()), hal_.eeprom.begin());
    start();
}

// The splitmix64 generator: neighbouring seeds give unrelated nonces.
static uint32_t next_nonce(uint64_t &state)
{
    state += 0x9E3779B97F4A7C15u;
    uint64_t z = state;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return static_cast<uint32_t>((z ^ (z >> 31)) >> 32);
}

void Board::start()
{
    hal_.boot_nonce = next_nonce(nonce_state_);
    hal_.received.clear();
    hal_.to_transmit.clear();
    hal_.received_lost = 0;
    start_us_ = now_us_;
    tick_at_us_ = now_us_ + ROBOT_TICK_US;
    hung_until_us_ = now_us_;
    byte_out_at_us_ = never;
    watchdog_at_us_ = now_us_ + watchdog_us;
    robot_init(&robot_, &hal_);
    run_main_loop();
}

void Board::reset(uint8_t cause)
{
    hal_.reset_cause = cause;
    start();
}

// --- Time ------------------------------------------------------------------------------------------

int64_t Board::next_event_us() const
{
    int64_t edge = edges_.empty() ? never : edges_.front().at_us;
    int64_t main_loop = std::max(tick_at_us_, hung_until_us_);
    return std::min({edge, byte_in_at_us_, byte_out_at_us_, main_loop, watchdog_at_us_});
}

void Board::step(int64_t us)
{
    int64_t until = now_us_ + us;
    for (int64_t at = next_event_us(); at <= until; at = next_event_us()) {
        set_now(std::max(now_us_, at));
        run_events();
    }
    set_now(until);
}

void Board::set_now(int64_t us)
{
    now_us_ = us;
    hal_.now_us = us;
}

void Board::run_events()
{
    while (!edges_.empty() && edges_.front().at_us <= now_us_) {
        Edge edge = edges_.front();
        edges_.pop_front();
        hal_.pins[edge.side] = edge.pins;
        robot_encoder_edge(&robot_, edge.side, edge.pins, static_cast<uint16_t>(mcu_us() / ENCODER_STAMP_US));
    }
    if (byte_in_at_us_ <= now_us_) {
        if (hal_.received.size() < hal::receive_size)
            hal_.received.push_back(to_board_.front());
        else
            hal_.received_lost++;
        to_board_.pop_front();
        byte_in_at_us_ = to_board_.empty() ? never : now_us_ + byte_us;
    }
    if (byte_out_at_us_ <= now_us_) {
        from_board_.push_back(static_cast<char>(hal_.to_transmit.front()));
        hal_.to_transmit.pop_front();
        byte_out_at_us_ = never;
    }
    run_main_loop();
    if (watchdog_at_us_ <= now_us_)
        reset(RESET_WATCHDOG);
}

void Board::run_main_loop()
{
    if (now_us_ >= hung_until_us_) {
        while (!hal_.received.empty()) {
            uint8_t byte = hal_.received.front();
            hal_.received.pop_front();
            robot_receive_byte(&robot_, byte, mcu_us());
        }
        if (now_us_ >= tick_at_us_) {
            robot_tick(&robot_, mcu_us());
            watchdog_at_us_ = now_us_ + watchdog_us;
            while (tick_at_us_ <= now_us_) // ticks missed while hung are gone
                tick_at_us_ += ROBOT_TICK_US;
        }
    }
    if (byte_out_at_us_ == never && !hal_.to_transmit.empty())
        byte_out_at_us_ = now_us_ + byte_us;
}

void Board::hang(int64_t us)
{
    hung_until_us_ = std::max(hung_until_us_, now_us_ + us);
}

// --- Line and pins ---------------------------------------------------------------------------------

void Board::write(std::string_view bytes)
{
    to_board_.insert(to_board_.end(), bytes.begin(), bytes.end());
    if (byte_in_at_us_ == never && !to_board_.empty())
        byte_in_at_us_ = now_us_ + byte_us;
}

std::string Board::read()
{
    std::string bytes;
    bytes.swap(from_board_);
    return bytes;
}

void Board::set_encoder_pins(uint8_t side, bool a, bool b, int64_t at_us)
{
    Edge edge{at_us, side, static_cast<uint8_t>((b ? 2 : 0) | (a ? 1 : 0))};
    auto later = std::find_if(edges_.rbegin(), edges_.rend(), [&](const Edge &e) { return e.at_us <= at_us; });
    edges_.insert(later.base(), edge);
    if (at_us <= now_us_)
        run_events();
}
