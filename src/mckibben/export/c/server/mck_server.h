/* A model behind a wire: bytes in, bytes out, and time told by ticks. docs/deploy/link.md is the protocol.
 *
 * Nothing is allocated, nothing blocks, and every call ends in bounded time: at most one frame of
 * 250 bytes is looked at, and one step of the model taken. Call all functions from one context (such as the
 * main loop): an interrupt hands over bytes and ticks, it does not call.
 *
 * Outputs are the safe values before the first inputs have come, and again once the host was silent
 * for too long; they are finite and within the limits of the export at any time.
 */
#ifndef MCK_SERVER_H
#define MCK_SERVER_H

#include <stdint.h>

#include "mck.h"

#define MCK_LINK_VERSION 1u
#define MCK_PAYLOAD 250                /* bytes of a frame before it is stuffed, at most */
#define MCK_STUFFED (MCK_PAYLOAD + 2) /* and after, with the zero that ends it */

typedef struct {
    const char *name;
    const char *unit;
    mck_real low;
    mck_real high;
    mck_real safe; /* of an output */
} mck_channel;

/* What was fixed at export. */
typedef struct {
    uint8_t fingerprint[8];
    uint32_t period;  /* time between ticks [us] */
    uint32_t silence; /* ticks without a good frame, at most */
    int n_inputs;
    int n_missable; /* of them the last, which may be missing: NaN */
    int n_outputs;
    int n_memory; /* numbers of the model's memory that can be read */
    const mck_channel *channels; /* inputs, then outputs */
    int (*step)(void *model, const mck_real *in, mck_real *out);
    void (*reset)(void *model);
} mck_served;

/* A frame on its way out. */
typedef struct {
    uint8_t bytes[MCK_STUFFED];
    int length; /* 0 where there is none */
    int at;
} mck_frame;

typedef struct {
    const mck_served *served;
    void *model;
    mck_real *in;
    mck_real *out;
    uint8_t *own; /* of every input: set by the firmware, not by frames */
    const mck_real *memory;

    uint32_t session;
    uint32_t sequence;
    uint8_t last_kind;
    uint8_t last_status;
    int open;
    int lock_step;
    int running; /* inputs have come, and the host is not silent */
    int tripped;
    uint32_t silence;
    uint32_t quiet;
    uint32_t steps;
    uint16_t every;
    uint16_t since;
    uint8_t notes;
    uint32_t dropped;

    uint8_t frame[MCK_STUFFED];
    int length;
    int too_long;
    mck_frame answer;
    mck_frame sample;
    mck_frame *sending;
} mck_server;

/* Before anything else; `start` counts the starts of the device where that is kept, and is else 0: frames
 * from before a start are then known by it, however late they come. */
void mck_server_init(mck_server *self, uint32_t start);

/* Take a byte that came. */
void mck_server_receive(mck_server *self, uint8_t byte);

/* Return the next byte to send, or -1 where there is none. */
int mck_server_send(mck_server *self);

/* Once every period: counts the silence, and steps the model unless frames do. */
void mck_server_tick(mck_server *self);

/* Give an input from the firmware, such as a sensor's; frames do not set it any more. NaN says that one of
 * the missable is missing; of others it is not taken. */
void mck_server_measure(mck_server *self, int input, mck_real value);

#endif
