/* A model behind a serial line: bytes in, bytes out, time in ticks. docs/deploy/link.md is the protocol.
 *
 * Nothing is allocated, nothing blocks; a call reads one frame and takes one step at most. Call all
 * functions from one context, such as the main loop. Outputs are finite and within the limits of the
 * export at any time, and the safe ones until inputs come and after the host was silent for too long. */
#ifndef MCK_SERVER_H
#define MCK_SERVER_H

#include <stdint.h>

#include "mck.h"

#define MCK_LINK_VERSION 2u
#define MCK_PAYLOAD 250               /* bytes of a frame before it is stuffed, at most */
#define MCK_STUFFED (MCK_PAYLOAD + 2) /* and after, with the zero that ends it */

typedef struct {
    mck_real low;
    mck_real high;
    mck_real safe; /* of an output */
} mck_channel;

/* What was fixed at export. */
typedef struct {
    const char *about; /* all of this as text: JSON */
    uint8_t fingerprint[8];
    uint32_t silence; /* longest silence of a host [ticks] */
    int n_inputs;
    int n_missable; /* the last of them, which may be missing: NaN */
    int n_outputs;
    int n_memory;                /* numbers of the model's memory that can be read */
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

    uint32_t sequence; /* of the last frame */
    uint8_t last_kind;
    uint8_t last_status;
    uint8_t notes; /* of the last step */
    uint8_t running;
    uint8_t resumed; /* the last inputs ended a time with safe outputs */
    uint8_t tripped; /* the watchdog has acted since the last inputs */
    uint8_t lock_step;
    uint16_t every;   /* steps from one sample to the next; 0 for none */
    uint16_t since;   /* steps since the last sample */
    uint32_t silence; /* allowed [ticks] */
    uint32_t quiet;   /* ticks since the last inputs */
    uint32_t steps;   /* since the start, modulo 2^32 */

    uint8_t frame[MCK_STUFFED]; /* on its way in */
    int length;
    mck_frame answer;
    mck_frame sample;
    mck_frame *sending;
} mck_server;

/* Before anything else. */
void mck_server_init(mck_server *self);

/* Take a received byte. */
void mck_server_receive(mck_server *self, uint8_t byte);

/* Return the next byte to send, or -1 where there is none. */
int mck_server_send(mck_server *self);

/* Once every period: counts the silence, and steps the model unless the host does. */
void mck_server_tick(mck_server *self);

/* Set an input from the firmware, such as a sensor's; frames do not set it any more. NaN is ignored, but
 * for inputs that may be missing. */
void mck_server_measure(mck_server *self, int input, mck_real value);

#endif
