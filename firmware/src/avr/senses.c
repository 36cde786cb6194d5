// Port C, the converter and the button.
#include "senses.h" // this file's manual

#include <avr/io.h> // ports, converter

#include "../drive.h" // DRIVE_LEFT
#include "../hal.h"   // what is answered here
#include "pins.h"     // where things are wired

// The converter sees half the battery's voltage and measures 1024 steps up to its 5 V supply.
#define MV_PER_64_STEPS 625u

static void start_conversion(void)
{
    ADCSRA = 1u << ADEN | 1u << ADSC | 1u << ADPS2 | 1u << ADPS1 | 1u << ADPS0; // clock/128 = 125 kHz
}

void senses_init(void)
{
    PORTC |= PIN_LEFT_ENCODER | PIN_RIGHT_ENCODER;
    PORTD |= PIN_ESTOP;

    DIDR0 = PIN_BIT(PIN_BATTERY_ADC); // no digital input there
    ADMUX = 1u << REFS0 | PIN_BATTERY_ADC;
    start_conversion();
    while (ADCSRA & (1u << ADSC))
        ; // 25 cycles of the converter
}

uint8_t hal_encoder_pins(struct hal *hal, uint8_t side)
{
    (void)hal;
    return (uint8_t)(PINC >> (side == DRIVE_LEFT ? PIN_LEFT_SHIFT : PIN_RIGHT_SHIFT)) & 3u;
}

// Of the last tick: the measurement takes 0.1 ms, and nobody waits for it.
uint16_t hal_battery_mv(struct hal *hal)
{
    (void)hal;
    uint16_t mv = (uint16_t)((uint32_t)ADC * MV_PER_64_STEPS / 64u);
    start_conversion();
    return mv == 0 ? 1 : mv; // 0 would say that it cannot be measured
}

bool hal_estop_pressed(struct hal *hal)
{
    (void)hal;
    return (PIND & PIN_ESTOP) != 0;
}
