#include "mck_server.h"

#include <stddef.h>
#include <string.h>

#define HEAD 10
#define CHECK 4
#define ROOM (MCK_PAYLOAD - HEAD - CHECK)
#define ANSWER 0x80u
#define SETTINGS 7 /* bytes of a frame of inputs before the numbers */
#define NUMBER ((int)sizeof(mck_real))

enum { IDENTIFY = 1, STATE, READ, INPUTS, RESET, RELEASE, SAMPLE };
enum { OK, MALFORMED, BEYOND_LIMITS, OTHER_MODEL };

enum { RUNNING = 1, TRIPPED = 2, LIMITED = 4, BAD_INPUT = 8, BAD_OUTPUT = 16, RESUMED = 32, CLIPPED = 64 };

#ifdef MCK_FLOAT32
typedef uint32_t bits;
#else
typedef uint64_t bits;
#endif

static uint32_t crc32(const uint8_t *bytes, int n)
{
    uint32_t crc = 0xFFFFFFFFu;
    for (int i = 0; i < n; i++) {
        crc ^= bytes[i];
        for (int k = 0; k < 8; k++) {
            crc = (crc >> 1) ^ (0xEDB88320u & (0u - (crc & 1u)));
        }
    }
    return ~crc;
}

static bits get(const uint8_t *bytes, int n)
{
    bits value = 0;
    while (n > 0) {
        value = (value << 8) | bytes[--n];
    }
    return value;
}

static mck_real get_number(const uint8_t *bytes)
{
    const bits from = get(bytes, NUMBER);
    mck_real value;
    memcpy(&value, &from, sizeof value);
    return value;
}

static void put(mck_frame *to, bits value, int n)
{
    for (int i = 0; i < n && to->length < MCK_STUFFED - 1; i++) {
        to->bytes[to->length++] = (uint8_t)(value & 0xFFu);
        value >>= 8;
    }
}

static void put_numbers(mck_frame *to, const mck_real *values, int n)
{
    for (int i = 0; i < n; i++) {
        bits value;
        memcpy(&value, &values[i], sizeof value);
        put(to, value, NUMBER);
    }
}

/* Begin an answer, behind the byte that stuffing adds. */
static void begin(const mck_server *self, mck_frame *to, uint8_t kind, uint8_t status)
{
    to->length = 1;
    put(to, MCK_LINK_VERSION, 1);
    put(to, kind | ANSWER, 1);
    for (int i = 0; i < 4; i++) {
        put(to, self->served->fingerprint[i], 1);
    }
    put(to, self->sequence, 4);
    put(to, status, 1);
}

/* Add the checksum, and stuff (COBS): each zero becomes the distance to the next one. */
static void finish(mck_frame *to)
{
    int mark = 0;
    put(to, crc32(to->bytes + 1, to->length - 1), CHECK);
    for (int i = 1; i < to->length; i++) {
        if (to->bytes[i] == 0u) {
            to->bytes[mark] = (uint8_t)(i - mark);
            mark = i;
        }
    }
    to->bytes[mark] = (uint8_t)(to->length - mark);
    to->bytes[to->length++] = 0u;
    to->at = 0;
}

/* Undo the stuffing in place: the content follows the first byte. Return whether it was stuffed. */
static int unstuffed(uint8_t *bytes, int n)
{
    int at = 0;
    while (at < n) {
        const int next = at + bytes[at];
        bytes[at] = 0u;
        at = next;
    }
    return at == n;
}

static void make_safe(mck_server *self)
{
    const mck_channel *outputs = self->served->channels + self->served->n_inputs;
    for (int i = 0; i < self->served->n_outputs; i++) {
        self->out[i] = outputs[i].safe;
    }
    self->running = 0;
    self->notes = 0;
}

static void put_state(const mck_server *self, mck_frame *to)
{
    const int now = self->running * RUNNING + self->tripped * TRIPPED + self->resumed * RESUMED;
    put(to, (bits)(self->notes + now), 1);
    put(to, self->steps, 4);
    put_numbers(to, self->out, self->served->n_outputs);
    put_numbers(to, self->in, self->served->n_inputs);
}

static void step(mck_server *self)
{
    const mck_channel *outputs = self->served->channels + self->served->n_inputs;
    const int status = self->served->step(self->model, self->in, self->out);
    int found = (status & 1 ? BAD_INPUT : 0) | (status & 2 ? BAD_OUTPUT : 0) | (status & 4 ? CLIPPED : 0);
    for (int i = 0; i < self->served->n_outputs; i++) {
        const mck_real limited = mck_min(mck_max(self->out[i], outputs[i].low), outputs[i].high);
        if (limited < self->out[i] || limited > self->out[i]) {
            found |= LIMITED;
        }
        self->out[i] = limited;
    }
    self->notes = (uint8_t)found;
    self->steps++;
    self->since++;
    if (self->every != 0u && self->since >= self->every) {
        self->since = 0;
        if (self->sample.length == 0) { /* else the line is too slow for it */
            begin(self, &self->sample, SAMPLE, OK);
            put_state(self, &self->sample);
            finish(&self->sample);
        }
    }
}

static int missable(const mck_served *served, int input)
{
    return input >= served->n_inputs - served->n_missable;
}

/* Inputs come with how they are used, so that a frame needs none before it. */
static uint8_t take_inputs(mck_server *self, const uint8_t *body, int n)
{
    const mck_served *served = self->served;
    if (n != SETTINGS + served->n_inputs * NUMBER || body[0] > 1u) {
        return MALFORMED;
    }
    const uint32_t silence = (uint32_t)get(body + 3, 4);
    if (silence == 0u || silence > served->silence) {
        return BEYOND_LIMITS;
    }
    for (int set = 0; set < 2; set++) { /* all are checked before any is set */
        for (int i = 0; i < served->n_inputs; i++) {
            const mck_channel *channel = &served->channels[i];
            const mck_real value = get_number(body + SETTINGS + i * NUMBER);
            const int within = value >= channel->low && value <= channel->high; /* NaN never is */
            if (!self->own[i] && !within && !missable(served, i)) {
                return BEYOND_LIMITS;
            }
            if (!self->own[i] && set) {
                self->in[i] = within ? value : (mck_real)NAN;
            }
        }
    }
    self->lock_step = body[0];
    self->every = (uint16_t)get(body + 1, 2);
    self->silence = silence;
    self->quiet = 0;
    self->resumed = !self->running;
    self->running = 1;
    self->tripped = 0;
    if (self->lock_step) {
        step(self);
    }
    return OK;
}

static uint8_t execute(mck_server *self, uint8_t kind, const uint8_t *body, int n)
{
    const int first = n >= 2 ? (int)get(body, 2) : 0;
    int fits = n == 0;
    if (kind == INPUTS) {
        return take_inputs(self, body, n);
    }
    if (kind == IDENTIFY) {
        fits = n == 2 && first <= (int)strlen(self->served->about);
    } else if (kind == READ) {
        fits = n == 3 && body[2] * NUMBER < ROOM && first + body[2] <= self->served->n_memory;
    } else if (kind == RESET && fits) {
        self->served->reset(self->model);
    } else if (kind == RELEASE && fits) {
        make_safe(self);
        self->tripped = 0;
    } else if (kind != STATE) {
        fits = 0;
    }
    return fits ? OK : MALFORMED;
}

static void handle(mck_server *self, const uint8_t *frame, int length)
{
    const uint8_t kind = frame[1];
    const uint32_t sequence = (uint32_t)get(frame + 6, 4);
    const uint8_t *body = frame + HEAD;
    if ((kind & ANSWER) != 0u || self->answer.length != 0) {
        return; /* an echo, or what could not be answered yet */
    }
    /* the last frame again: its answer was lost, and it changes nothing again */
    const int asks = kind == IDENTIFY || kind == READ;
    if (asks || kind != self->last_kind || sequence != self->sequence) {
        const int other = memcmp(frame + 2, self->served->fingerprint, 4) != 0;
        self->last_kind = kind;
        self->sequence = sequence;
        self->last_status = kind != IDENTIFY && other ? OTHER_MODEL
                                                      : execute(self, kind, body, length - HEAD);
    }
    begin(self, &self->answer, kind, self->last_status);
    if (self->last_status == OK && kind == IDENTIFY) {
        const char *text = self->served->about + get(body, 2);
        for (int i = 0; i < ROOM - 1 && text[i] != '\0'; i++) {
            put(&self->answer, (uint8_t)text[i], 1);
        }
    } else if (self->last_status == OK && kind == READ) {
        put_numbers(&self->answer, self->memory + get(body, 2), body[2]);
    } else if (self->last_status == OK) {
        put_state(self, &self->answer);
    }
    finish(&self->answer);
}

void mck_server_init(mck_server *self)
{
    const size_t first = offsetof(mck_server, sequence); /* what is before is fixed */
    memset((uint8_t *)self + first, 0, sizeof *self - first);
    for (int i = 0; i < self->served->n_inputs; i++) {
        self->in[i] = self->served->channels[i].low;
        self->own[i] = 0;
    }
    make_safe(self);
}

void mck_server_receive(mck_server *self, uint8_t byte)
{
    if (byte != 0u) {
        if (self->length < MCK_STUFFED) { /* one more than a frame has: too long */
            self->frame[self->length++] = byte;
        }
        return;
    }
    const int n = self->length - 1 - CHECK; /* of the content */
    if (n >= HEAD && self->length < MCK_STUFFED && unstuffed(self->frame, self->length) &&
        self->frame[1] == MCK_LINK_VERSION &&
        crc32(self->frame + 1, n) == (uint32_t)get(self->frame + 1 + n, 4)) {
        handle(self, self->frame + 1, n);
    }
    self->length = 0;
}

int mck_server_send(mck_server *self)
{
    mck_frame *next = self->answer.length != 0 ? &self->answer : &self->sample;
    mck_frame *frame = self->sending != NULL ? self->sending : next;
    if (frame->length == 0) {
        return -1;
    }
    self->sending = frame;
    const int byte = frame->bytes[frame->at++];
    if (frame->at == frame->length) {
        frame->length = 0;
        self->sending = NULL;
    }
    return byte;
}

void mck_server_tick(mck_server *self)
{
    if (self->running && ++self->quiet > self->silence) {
        make_safe(self);
        self->tripped = 1;
    }
    if (self->running && !self->lock_step) {
        step(self);
    }
}

void mck_server_measure(mck_server *self, int input, mck_real value)
{
    if (input >= 0 && input < self->served->n_inputs &&
        (isfinite(value) || missable(self->served, input))) {
        self->in[input] = value;
        self->own[input] = 1;
    }
}
