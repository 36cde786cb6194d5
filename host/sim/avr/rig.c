// An ATmega328P on a bench, over libsimavr. Like libsimavr, under the GNU General Public License, version 3.
#include "rig.h" // this file's manual

#include <math.h>   // NAN
#include <stdarg.h> // va_list
#include <stdlib.h> // calloc, realloc, free
#include <string.h> // memcpy, memmove, strcmp

#include <avr_adc.h>           // battery
#include <avr_extint.h>        // the button's pin
#include <avr_ioport.h>        // pins
#include <avr_uart.h>          // the line
#include <sim_avr.h>           // the processor
#include <sim_cycle_timers.h>  // events
#include <sim_elf.h>           // reading the ELF
#include <sim_interrupts.h>    // watching interrupts

enum {
    HZ = 16000000,
    LINE_BAUD = 250000,     // unless rig_baud() says otherwise
    ENTRY = 4,              // cycles of an interrupt's entry, which simavr leaves out
    RETURN = 4,             // of reti, which it adds only after saying that the interrupt ended
    RX_PLACES = 3,          // two, and the shift register
    FIRST_RAM = 0x100,
    LAST_RAM = 0x8FF,
    RAM_SIZE = LAST_RAM + 1 - FIRST_RAM,
    VECTORS = 26,
    EEPROM_SIZE = 1024,
    EEPROM_ERASE_AND_WRITE = HZ / 10000 * 34, // 3.4 ms
    EEPROM_ONE_OF_THEM = HZ / 10000 * 18,
    EEPROM_ARMED = 4,       // cycles within which EEPE must follow EEMPE
    MENDS = 64,
    STUB_WORDS = 7,
    FLASH_SIZE = 0x8000,
    BOOTLOADER = 0x7800,    // the largest begins there

    // Data addresses of the registers looked at.
    EECR = 0x3F, EEDR = 0x40, EEARL = 0x41, EEARH = 0x42,
    DDRB = 0x24, PORTB = 0x25, DDRD = 0x2A, PORTD = 0x2B, MCUSR = 0x54,
    TIMSK1 = 0x6F, TCCR1A = 0x80, TCCR1B = 0x81, ICR1 = 0x86, OCR1A = 0x88, OCR1B = 0x8A,
    UCSR0A = 0xC0, UBRR0 = 0xC4, UDR0 = 0xC6,
};

struct edge {
    uint64_t at;
    uint8_t side, pins;
};

struct sent {
    uint64_t at; // its stop bit has ended
    uint8_t byte;
};

struct interrupt_watch {
    struct rig *rig;
    uint8_t vector;
    uint64_t began;
};

// Two words of the program that now are a jump to where they are done right.
struct mend {
    size_t at, stub;
    uint16_t words[2];
};

struct rig {
    avr_t *avr;
    avr_uart_t *uart;
    uint64_t gone; // cycles before avr->cycle last began at 0
    uint64_t hung_until;
    uint8_t noise[RAM_SIZE];

    struct edge *edges; // by time; those before edge_first have been
    size_t edge_first, edge_count, edge_size;
    unsigned line_bit; // cycles
    uint8_t *to_avr;   // those before to_avr_first have come
    size_t to_avr_first, to_avr_count, to_avr_size;
    uint64_t byte_in_at; // when the next of to_avr has come; 0: nothing on the line
    struct sent *sent;
    size_t sent_count, sent_size;
    uint64_t sending_until;

    uint8_t rx[RX_PLACES];
    uint64_t rx_came[RX_PLACES];
    uint8_t rx_count;

    uint8_t eeprom[EEPROM_SIZE];
    uint16_t eeprom_address; // being written
    uint8_t eeprom_byte;     // what will stand there
    uint64_t eeprom_done_at; // 0: nothing is being written
    uint64_t eeprom_armed_at;

    struct mend mends[MENDS];
    size_t mend_count;
    int bootloader; // the program may change itself

    uint8_t port_c, port_d; // levels driven from outside
    uint32_t battery_mv;

    struct interrupt_watch watches[VECTORS];
    int watch_mask;
    uint64_t masked_since; // 0: interrupts are on
    uint64_t stats_since;
    struct rig_stats stats;
    int was_reset;
    uint64_t cycle_at_reset;
};

static uint64_t now(const struct rig *rig)
{
    return rig->gone + rig->avr->cycle;
}

static void *grow(void *items, size_t *size, size_t needed, size_t each)
{
    if (needed <= *size)
        return items;
    *size = needed * 2;
    return realloc(items, *size * each);
}

// --- Pins ------------------------------------------------------------------------------------------

enum { ENCODER_PINS = 0x0F, ESTOP_PIN = 0x04 };

static void drive_port(struct rig *rig, char port, uint8_t mask, uint8_t levels)
{
    avr_ioport_external_t external = {.name = port, .mask = mask, .value = levels};
    avr_ioctl(rig->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(port), &external);
    for (int pin = 0; pin < 8; pin++)
        if (mask >> pin & 1)
            avr_raise_irq(avr_io_getirq(rig->avr, AVR_IOCTL_IOPORT_GETIRQ(port), pin), levels >> pin & 1);
}

// The button's pin is INT0's too. The firmware does not use it, but simavr would poll a low level every cycle.
static void unwire_int0(struct rig *rig)
{
    avr_unconnect_irq(avr_io_getirq(rig->avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 2),
                      avr_io_getirq(rig->avr, AVR_IOCTL_EXTINT_GETIRQ(), EXTINT_IRQ_OUT_INT0));
}

static void drive_all(struct rig *rig)
{
    drive_port(rig, 'C', ENCODER_PINS, rig->port_c);
    drive_port(rig, 'D', ESTOP_PIN, rig->port_d);
    avr_raise_irq(avr_io_getirq(rig->avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC4), rig->battery_mv / 2);
}

static int edge_due(const struct rig *rig)
{
    return rig->edge_first < rig->edge_count && rig->edges[rig->edge_first].at <= now(rig);
}

static avr_cycle_count_t edge_event(avr_t *avr, avr_cycle_count_t when, void *param)
{
    struct rig *rig = param;
    (void)avr, (void)when;
    while (edge_due(rig)) {
        const struct edge *edge = &rig->edges[rig->edge_first++];
        uint8_t shift = edge->side ? 2 : 0;
        rig->port_c = (uint8_t)((rig->port_c & ~(3 << shift)) | edge->pins << shift);
        drive_port(rig, 'C', ENCODER_PINS, rig->port_c);
    }
    if (rig->edge_first < rig->edge_count)
        return rig->edges[rig->edge_first].at - rig->gone;
    rig->edge_first = rig->edge_count = 0;
    return 0;
}

// --- Line ------------------------------------------------------------------------------------------

static int baud_fits(struct rig *rig)
{
    const uint8_t *data = rig->avr->data;
    int bit = (data[UBRR0] + 256 * (data[UBRR0 + 1] & 0x0F) + 1) * (data[UCSR0A] & 0x02 ? 8 : 16);
    rig->uart->cycles_per_byte = 10u * (unsigned)bit;
    if (abs(bit - (int)rig->line_bit) * 40 <= (int)rig->line_bit) // within 2.5 %, as receivers bear
        return 1;
    rig->stats.rx_wrong_baud++;
    return 0;
}

static void take_byte(struct rig *rig, uint8_t byte)
{
    if (!avr_regbit_get(rig->avr, rig->uart->rxen) || !baud_fits(rig))
        return;
    if (rig->rx_count == RX_PLACES) {
        rig->stats.rx_overruns++;
        avr_regbit_setto(rig->avr, rig->uart->dor, 1);
        return;
    }
    rig->rx_came[rig->rx_count] = now(rig);
    rig->rx[rig->rx_count++] = byte;
    avr_raise_interrupt(rig->avr, &rig->uart->rxc);
}

static uint8_t read_udr(avr_t *avr, avr_io_addr_t addr, void *param)
{
    struct rig *rig = param;
    (void)addr;
    avr_clear_interrupt(avr, &rig->uart->rxc);
    avr_regbit_clear(avr, rig->uart->rxc.raised);
    avr_regbit_clear(avr, rig->uart->dor);
    if (rig->rx_count == 0)
        return 0;
    uint8_t byte = rig->rx[0];
    uint64_t waited = now(rig) - rig->rx_came[0];
    if (waited > rig->stats.byte_wait_worst_cycles)
        rig->stats.byte_wait_worst_cycles = waited;
    rig->rx_count--;
    memmove(rig->rx, rig->rx + 1, rig->rx_count);
    memmove(rig->rx_came, rig->rx_came + 1, rig->rx_count * sizeof *rig->rx_came);
    if (rig->rx_count > 0)
        avr_raise_interrupt(avr, &rig->uart->rxc);
    return byte;
}

static avr_cycle_count_t byte_event(avr_t *avr, avr_cycle_count_t when, void *param)
{
    struct rig *rig = param;
    (void)avr, (void)when;
    while (rig->to_avr_first < rig->to_avr_count && rig->byte_in_at <= now(rig)) {
        take_byte(rig, rig->to_avr[rig->to_avr_first++]);
        rig->byte_in_at += 10 * rig->line_bit;
    }
    if (rig->to_avr_first == rig->to_avr_count)
        rig->to_avr_first = rig->to_avr_count = rig->byte_in_at = 0;
    return rig->byte_in_at ? rig->byte_in_at - rig->gone : 0;
}

static void byte_written(struct avr_irq_t *irq, uint32_t byte, void *param)
{
    struct rig *rig = param;
    (void)irq;
    if (!baud_fits(rig))
        return;
    uint64_t from = now(rig) > rig->sending_until ? now(rig) : rig->sending_until;
    rig->sending_until = from + 10 * rig->line_bit;
    rig->sent = grow(rig->sent, &rig->sent_size, rig->sent_count + 1, sizeof *rig->sent);
    rig->sent[rig->sent_count++] = (struct sent){rig->sending_until, (uint8_t)byte};
}

void rig_write(struct rig *rig, const uint8_t *bytes, size_t count)
{
    if (count == 0)
        return;
    rig->to_avr = grow(rig->to_avr, &rig->to_avr_size, rig->to_avr_count + count, 1);
    memcpy(rig->to_avr + rig->to_avr_count, bytes, count);
    rig->to_avr_count += count;
    if (rig->byte_in_at == 0) {
        rig->byte_in_at = now(rig) + 10 * rig->line_bit;
        avr_cycle_timer_register(rig->avr, 10 * rig->line_bit, byte_event, rig);
    }
}

size_t rig_read(struct rig *rig, uint8_t *bytes, size_t size)
{
    size_t count = 0;
    while (count < size && count < rig->sent_count && rig->sent[count].at <= now(rig)) {
        bytes[count] = rig->sent[count].byte;
        count++;
    }
    rig->sent_count -= count;
    memmove(rig->sent, rig->sent + count, rig->sent_count * sizeof *rig->sent);
    return count;
}

void rig_baud(struct rig *rig, uint32_t baud)
{
    rig->line_bit = (HZ + baud / 2) / baud;
}

// --- EEPROM ----------------------------------------------------------------------------------------

enum { EERE = 1, EEPE = 2, EEMPE = 4, EERIE = 8, EEPM_SHIFT = 4 };

static void eeprom_settle(struct rig *rig)
{
    if (rig->eeprom_done_at == 0 || rig->eeprom_done_at > now(rig))
        return;
    rig->eeprom[rig->eeprom_address] = rig->eeprom_byte;
    rig->eeprom_done_at = 0;
}

// Power goes: the cell being written may hold anything afterwards.
static void eeprom_cut(struct rig *rig, uint8_t chance)
{
    eeprom_settle(rig);
    if (rig->eeprom_done_at != 0)
        rig->eeprom[rig->eeprom_address] = chance;
    rig->eeprom_done_at = 0;
}

static uint16_t eeprom_register(const struct rig *rig)
{
    return (uint16_t)((rig->avr->data[EEARL] | rig->avr->data[EEARH] << 8) % EEPROM_SIZE);
}

static int eeprom_is_armed(const struct rig *rig)
{
    return rig->eeprom_armed_at != 0 && now(rig) - rig->eeprom_armed_at <= EEPROM_ARMED;
}

static void eeprom_begin(struct rig *rig, uint8_t mode)
{
    uint8_t byte = rig->avr->data[EEDR], old;
    rig->eeprom_address = eeprom_register(rig);
    old = rig->eeprom[rig->eeprom_address];
    rig->eeprom_byte = mode == 1 ? 0xFF : mode == 2 ? old & byte : byte;
    rig->eeprom_done_at = now(rig) + (mode == 0 ? EEPROM_ERASE_AND_WRITE : EEPROM_ONE_OF_THEM);
    rig->eeprom_armed_at = 0;
    rig->avr->cycle += 2; // the processor stands
}

static void write_eecr(avr_t *avr, avr_io_addr_t addr, uint8_t value, void *param)
{
    struct rig *rig = param;
    eeprom_settle(rig);
    int busy = rig->eeprom_done_at != 0;
    if (value & EEPE && !busy && eeprom_is_armed(rig))
        eeprom_begin(rig, value >> EEPM_SHIFT & 3);
    else if (value & EERE && !busy) {
        avr->data[EEDR] = rig->eeprom[eeprom_register(rig)];
        avr->cycle += 4;
    }
    if (value & EEMPE && !(value & EEPE))
        rig->eeprom_armed_at = now(rig);
    avr->data[addr] = value & (uint8_t)~(EERE | EEPE | EEMPE);
}

static uint8_t read_eecr(avr_t *avr, avr_io_addr_t addr, void *param)
{
    struct rig *rig = param;
    eeprom_settle(rig);
    uint8_t kept = avr->data[addr] & (uint8_t)~(EERE | EEPE | EEMPE);
    return (uint8_t)(kept | (rig->eeprom_done_at ? EEPE : 0) | (eeprom_is_armed(rig) ? EEMPE : 0));
}

void rig_eeprom_set(struct rig *rig, const uint8_t *bytes)
{
    rig->eeprom_done_at = 0;
    memcpy(rig->eeprom, bytes, EEPROM_SIZE);
}

void rig_eeprom(struct rig *rig, uint8_t *bytes)
{
    eeprom_settle(rig);
    memcpy(bytes, rig->eeprom, EEPROM_SIZE);
}

// --- Interrupts and sleep --------------------------------------------------------------------------

static void interrupt_changed(struct avr_irq_t *irq, uint32_t running, void *param)
{
    struct interrupt_watch *watch = param;
    struct rig *rig = watch->rig;
    (void)irq;
    if (running) {
        watch->began = now(rig);
        if (rig->masked_since == 0)
            rig->masked_since = now(rig); // looking comes only after the first instruction
        rig->avr->cycle += ENTRY;
        return;
    }
    struct rig_interrupt *stats = &rig->stats.interrupts[watch->vector];
    uint64_t took = now(rig) + RETURN - watch->began;
    stats->runs++;
    stats->cycles += took;
    if (took > stats->worst_cycles)
        stats->worst_cycles = took;
}

static void sleep_on(avr_t *avr, avr_cycle_count_t cycles)
{
    struct rig *rig = avr->custom.data;
    rig->stats.asleep_cycles += cycles + 1; // as many as simavr will add
}

static void watch_interrupts(struct rig *rig)
{
    for (uint8_t vector = 1; vector < VECTORS; vector++) {
        struct interrupt_watch *watch = &rig->watches[vector];
        watch->rig = rig;
        watch->vector = vector;
        avr_irq_t *irq = avr_get_interrupt_irq(rig->avr, vector);
        if (irq)
            avr_irq_register_notify(irq + AVR_INT_IRQ_RUNNING, interrupt_changed, watch);
    }
}

static void look_at_mask(struct rig *rig)
{
    int masked = !rig->avr->sreg[S_I];
    if (masked && rig->masked_since == 0)
        rig->masked_since = now(rig);
    if (!masked && rig->masked_since != 0) {
        uint64_t took = now(rig) - rig->masked_since;
        if (took > rig->stats.masked_worst_cycles)
            rig->stats.masked_worst_cycles = took;
        rig->masked_since = 0;
    }
}

// --- An instruction that simavr gets wrong ---------------------------------------------------------

static int is_skip(uint16_t word)
{
    return (word & 0xFC00) == 0x1000       // cpse
        || (word & 0xFC08) == 0xFC00       // sbrc, sbrs
        || (word & 0xFD00) == 0x9900;      // sbic, sbis
}

// adiw or sbiw with a constant that makes simavr, deciding how far to skip, take it for a call or jump.
static int is_mistaken_for_long(uint16_t word)
{
    return (word & 0xFE00) == 0x9600 && (word & 0x0C) == 0x0C;
}

static int is_long(uint16_t word)
{
    return (word & 0xFC0F) == 0x9000       // lds, sts
        || (word & 0xFE0C) == 0x940C;      // jmp, call
}

// The program as it was written.
static void unmend(const struct rig *rig, uint16_t *flash)
{
    for (size_t k = 0; k < rig->mend_count; k++) {
        const struct mend *mend = &rig->mends[k];
        if (flash[mend->at] == 0x940C && flash[mend->at + 1] == mend->stub) { // not programmed anew since
            memcpy(flash + mend->at, mend->words, sizeof mend->words);
            memset(flash + mend->stub, 0xFF, STUB_WORDS * sizeof *flash);
        }
    }
}

// Moves each such pair of instructions past the end of the program, where a plain branch does the skip's work,
// and puts a jump in its place. The pair takes 3 to 6 cycles longer; nothing else changes.
static void mend_skips(struct rig *rig)
{
    uint16_t *flash = (uint16_t *)rig->avr->flash; // both machines are little endian
    unmend(rig, flash);
    rig->mend_count = 0;
    size_t end = BOOTLOADER / 2; // of the program, the variables' first values included
    while (end > 0 && flash[end - 1] == 0xFFFF)
        end--;
    size_t stub = end;
    // Constants lie between the vectors and the code, which starts where the reset vector leads.
    size_t at = flash[0] == 0x940C ? flash[1] : end;
    for (; at + 1 < end && rig->mend_count < MENDS; at++) {
        if (is_long(flash[at])) {
            at++; // an address is no instruction, whatever it looks like
            continue;
        }
        if (!is_skip(flash[at]) || !is_mistaken_for_long(flash[at + 1]))
            continue;
        rig->mends[rig->mend_count++] = (struct mend){at, stub, {flash[at], flash[at + 1]}};
        uint16_t back = (uint16_t)(at + 2);
        const uint16_t code[STUB_WORDS] = { // skip, rjmp, jmp, adiw, jmp
            flash[at], 0xC002, 0x940C, back, flash[at + 1], 0x940C, back,
        };
        memcpy(flash + stub, code, sizeof code);
        flash[at] = 0x940C;
        flash[at + 1] = (uint16_t)stub;
        stub += STUB_WORDS;
        at++;
    }
    rig->avr->codeend = rig->bootloader ? rig->avr->flashend : (avr_flashaddr_t)(stub * 2);
}

void rig_flash(const struct rig *rig, uint8_t *bytes)
{
    memcpy(bytes, rig->avr->flash, FLASH_SIZE);
    unmend(rig, (uint16_t *)bytes);
}

// --- Time ------------------------------------------------------------------------------------------

static avr_cycle_count_t nothing(avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)avr, (void)when, (void)param;
    return 0;
}

static void note_reset(avr_t *avr)
{
    struct rig *rig = avr->custom.data;
    rig->was_reset = 1;
    rig->cycle_at_reset = avr->cycle;
}

static void register_at(struct rig *rig, uint64_t at, avr_cycle_timer_t event)
{
    uint64_t in = at > now(rig) ? at - now(rig) : 1;
    avr_cycle_timer_register(rig->avr, in, event, rig);
}

// simavr has forgotten all events, and perhaps the time.
static void after_reset(struct rig *rig)
{
    rig->was_reset = 0;
    if (rig->avr->cycle < rig->cycle_at_reset)
        rig->gone += rig->cycle_at_reset - rig->avr->cycle;
    rig->rx_count = 0;
    while (rig->sent_count > 0 && rig->sent[rig->sent_count - 1].at > now(rig))
        rig->sent_count--; // cut off
    rig->sending_until = 0;
    rig->masked_since = 0;
    rig->hung_until = 0;
    rig->eeprom_armed_at = 0; // a write that is under way goes on
    if (rig->bootloader)
        mend_skips(rig);
    unwire_int0(rig);
    drive_all(rig);
    if (rig->edge_first < rig->edge_count)
        register_at(rig, rig->edges[rig->edge_first].at, edge_event);
    if (rig->byte_in_at)
        register_at(rig, rig->byte_in_at, byte_event);
}

// A main loop that never gets on: cycles pass and interrupts run.
static void stand_still(struct rig *rig)
{
    avr_t *avr = rig->avr;
    avr->state = cpu_Running;
    avr->cycle += 2;
    avr_cycle_timer_process(avr);
    avr_service_interrupts(avr);
}

int rig_run_to(struct rig *rig, uint64_t cycle)
{
    avr_t *avr = rig->avr;
    if (cycle > now(rig))
        avr_cycle_timer_register(avr, cycle - now(rig), nothing, rig); // sleep no further than this
    while (now(rig) < cycle) {
        int resetting = avr->run != avr_callback_run_raw; // the watchdog has put its own in place
        if (rig->hung_until > now(rig) && avr->interrupts.running_ptr == 0 && avr->sreg[S_I] && !resetting) {
            stand_still(rig);
        } else {
            int state = avr_run(avr);
            if (state == cpu_Crashed || state == cpu_Done)
                return -1;
        }
        if (rig->was_reset) {
            rig->stats.resets++;
            after_reset(rig);
            register_at(rig, cycle, nothing);
        }
        if (rig->watch_mask)
            look_at_mask(rig);
    }
    avr_cycle_timer_cancel(avr, nothing, rig);
    return 0;
}

// --- Bench -----------------------------------------------------------------------------------------

static void insert_edge(struct rig *rig, struct edge edge)
{
    rig->edges = grow(rig->edges, &rig->edge_size, rig->edge_count + 1, sizeof *rig->edges);
    size_t place = rig->edge_count++;
    for (; place > rig->edge_first && rig->edges[place - 1].at > edge.at; place--)
        rig->edges[place] = rig->edges[place - 1];
    rig->edges[place] = edge;
}

void rig_encoders(struct rig *rig, size_t count, const uint8_t *sides, const uint8_t *pins,
                  const uint64_t *at_cycles)
{
    for (size_t k = 0; k < count; k++)
        insert_edge(rig, (struct edge){at_cycles[k], sides[k], pins[k]});
    avr_cycle_timer_cancel(rig->avr, edge_event, rig);
    if (edge_due(rig))
        edge_event(rig->avr, 0, rig);
    if (rig->edge_first < rig->edge_count)
        register_at(rig, rig->edges[rig->edge_first].at, edge_event);
}

// Pins of ports B and D that are driven high.
static int driver_pin(const struct rig *rig, int port, int pin)
{
    const uint8_t *data = rig->avr->data;
    return (data[port ? DDRD : DDRB] & data[port ? PORTD : PORTB]) >> pin & 1;
}

static int is_on(const struct rig *rig)
{
    return driver_pin(rig, 1, 6); // standby
}

static int in1_of(const struct rig *rig, uint8_t side)
{
    return driver_pin(rig, 1, side ? 4 : 7);
}

static int in2_of(const struct rig *rig, uint8_t side)
{
    return side ? driver_pin(rig, 1, 5) : driver_pin(rig, 0, 0);
}

int rig_coasting(const struct rig *rig, uint8_t side)
{
    return !is_on(rig) || (!in1_of(rig, side) && !in2_of(rig, side));
}

double rig_duty(const struct rig *rig, uint8_t side)
{
    const uint8_t *data = rig->avr->data;
    int in1 = in1_of(rig, side), in2 = in2_of(rig, side);
    if (!is_on(rig) || in1 == in2)
        return 0;
    uint8_t connected = side ? data[TCCR1A] >> 4 & 3 : data[TCCR1A] >> 6 & 3;
    int mode = (data[TCCR1B] >> 1 & 0x0C) | (data[TCCR1A] & 3);
    int clock = data[TCCR1B] & 7;
    if (connected != 2 || mode != 8 || clock != 1 || data[TIMSK1] || !(data[DDRB] & (side ? 4 : 2)))
        return NAN;
    int compare = data[side ? OCR1B : OCR1A] | data[(side ? OCR1B : OCR1A) + 1] << 8;
    int top = data[ICR1] | data[ICR1 + 1] << 8;
    double share = top == 0 ? NAN : compare >= top ? 1.0 : (double)compare / top;
    return in1 ? share : -share;
}

void rig_battery_mv(struct rig *rig, uint32_t mv)
{
    rig->battery_mv = mv;
    drive_all(rig);
}

void rig_estop(struct rig *rig, int pressed)
{
    rig->port_d = pressed ? ESTOP_PIN : 0;
    drive_all(rig);
}

void rig_reset(struct rig *rig, uint8_t mcusr, const uint8_t *noise)
{
    enum { PORF = 1, BORF = 4 };
    if (mcusr & (PORF | BORF))
        eeprom_cut(rig, rig->noise[rig->eeprom_address % RAM_SIZE]);
    if (noise) {
        memcpy(rig->noise, noise, RAM_SIZE);
        memcpy(rig->avr->data + FIRST_RAM, noise, RAM_SIZE);
    }
    avr_reset(rig->avr);
    after_reset(rig);
    rig->avr->data[MCUSR] = mcusr;
}

uint8_t rig_peek(const struct rig *rig, uint16_t address)
{
    return rig->avr->data[address];
}

void rig_poke(struct rig *rig, uint16_t address, uint8_t byte)
{
    rig->avr->data[address] = byte;
}

void rig_hang(struct rig *rig, uint64_t cycles)
{
    rig->hung_until = now(rig) + cycles;
}

const struct rig_stats *rig_stats(struct rig *rig)
{
    rig->stats.cycles = now(rig) - rig->stats_since;
    return &rig->stats;
}

void rig_clear_stats(struct rig *rig)
{
    memset(&rig->stats, 0, sizeof rig->stats);
    rig->stats_since = now(rig);
}

void rig_watch_mask(struct rig *rig, int on)
{
    rig->watch_mask = on;
    rig->masked_since = 0;
    rig->avr->run_cycle_limit = on ? 1 : HZ / 1000;
}

size_t rig_stack_used(const struct rig *rig, uint16_t static_end)
{
    uint16_t at = (uint16_t)(static_end + 1); // the first byte is the firmware's own guard
    while (at <= LAST_RAM && rig->avr->data[at] == rig->noise[at - FIRST_RAM])
        at++;
    return (size_t)(LAST_RAM + 1 - at);
}

// --- Start -----------------------------------------------------------------------------------------

static void say_nothing(avr_t *avr, const int level, const char *format, va_list values)
{
    (void)avr, (void)level, (void)format, (void)values;
}

static avr_uart_t *find_uart(avr_t *avr)
{
    for (avr_io_t *io = avr->io_port; io; io = io->next)
        if (strcmp(io->kind, "uart") == 0)
            return (avr_uart_t *)io;
    return NULL;
}

struct rig *rig_new(const char *elf, const uint8_t *noise)
{
    avr_global_logger_set(say_nothing);
    elf_firmware_t firmware = {0};
    if (elf && elf_read_firmware(elf, &firmware) != 0)
        return NULL;
    avr_t *avr = avr_make_mcu_by_name("atmega328p");
    if (!avr)
        return NULL;
    struct rig *rig = calloc(1, sizeof *rig);
    rig->avr = avr;
    avr_init(avr);
    avr->log = LOG_NONE;
    avr->custom.data = rig;
    firmware.frequency = HZ;
    firmware.vcc = firmware.avcc = 5000;
    avr_load_firmware(avr, &firmware);
    mend_skips(rig);
    avr->sleep = sleep_on;
    avr->reset = note_reset;
    avr->run_cycle_limit = HZ / 1000;

    rig->uart = find_uart(avr);
    uint32_t no_flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &no_flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), byte_written, rig);
    avr->io[AVR_DATA_TO_IO(UDR0)].r.c = read_udr;
    avr->io[AVR_DATA_TO_IO(UDR0)].r.param = rig;
    avr->io[AVR_DATA_TO_IO(EECR)].r.c = read_eecr;
    avr->io[AVR_DATA_TO_IO(EECR)].r.param = rig;
    avr->io[AVR_DATA_TO_IO(EECR)].w.c = write_eecr;
    avr->io[AVR_DATA_TO_IO(EECR)].w.param = rig;
    watch_interrupts(rig);

    rig->battery_mv = 7400;
    rig_baud(rig, LINE_BAUD);
    memset(rig->eeprom, 0xFF, EEPROM_SIZE);
    rig_reset(rig, 1, noise); // power-on
    rig->stats.resets = 0;
    return rig;
}

void rig_bootloader(struct rig *rig, uint32_t address, const uint8_t *bytes, size_t count)
{
    avr_t *avr = rig->avr;
    memcpy(avr->flash + address, bytes, count);
    rig->bootloader = 1;
    avr->reset_pc = address; // fuse BOOTRST
    rig_reset(rig, 1, NULL);
    rig->stats.resets = 0;
}

void rig_free(struct rig *rig)
{
    if (!rig)
        return;
    rig->avr->custom.data = NULL;
    avr_terminate(rig->avr);
    free(rig->avr);
    free(rig->edges);
    free(rig->to_avr);
    free(rig->sent);
    free(rig);
}
