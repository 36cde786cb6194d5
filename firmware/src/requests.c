// Requests, done exactly once: which was the last, and what became of it. See requests.h.
#include "requests.h" // this file's manual

uint8_t requests_take(struct requests *requests, uint8_t message, uint16_t number, uint8_t refusal,
                      bool runs)
{
    requests->last = number;
    requests->reason = refusal;
    requests->running = 0;
    if (refusal != 0) {
        requests->outcome = OUTCOME_REFUSED;
    } else if (runs) {
        requests->outcome = OUTCOME_RUNNING;
        requests->running = message;
    } else {
        requests->outcome = OUTCOME_DONE;
    }
    return refusal;
}

void requests_end(struct requests *requests, uint8_t message, uint8_t outcome, uint8_t reason)
{
    if (requests->running != message)
        return;
    requests->running = 0;
    requests->outcome = outcome;
    requests->reason = reason;
}
