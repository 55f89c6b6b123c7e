#include "mck_server.h"

#include <string.h>

#define HEAD 10
#define CHECK 4
#define ROOM (MCK_PAYLOAD - HEAD - CHECK)
#define ANSWER 0x80u
#define HALF 0x80000000u
#define NUMBER ((int)sizeof(mck_real))

/* Kinds of frames. */
#define IDENTIFY 1u
#define DESCRIBE 2u
#define OPEN 3u
#define INPUTS 4u
#define STATE 5u
#define STREAM 6u
#define READ 7u
#define RESET 8u
#define KEEP 9u
#define RELEASE 10u
#define SAMPLE 11u

/* What an answer begins with. */
#define OK 0u
#define NO_SESSION 1u
#define BEYOND_LIMITS 2u
#define MALFORMED 3u
#define IS_SAFE 4u
#define OTHER_MODEL 5u
#define OLD_SESSION 6u

/* Notes beside outputs. */
#define NOTE_RUNNING 1u
#define NOTE_TRIPPED 2u
#define NOTE_LIMITED 4u
#define NOTE_BAD_INPUT 8u
#define NOTE_BAD_OUTPUT 16u
#define NOTE_LOCK_STEP 32u

/* A frame being written, before it is stuffed. */
typedef struct {
    uint8_t bytes[MCK_PAYLOAD];
    int length;
} writing;

static uint32_t crc32(const uint8_t *bytes, int n)
{
    static const uint32_t table[16] = {
        0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u,
        0x4DB26158u, 0x5005713Cu, 0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
        0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu,
    };
    uint32_t crc = 0xFFFFFFFFu;
    for (int i = 0; i < n; i++) {
        crc ^= bytes[i];
        crc = (crc >> 4) ^ table[crc & 15u];
        crc = (crc >> 4) ^ table[crc & 15u];
    }
    return ~crc;
}

static uint32_t get16(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] | ((uint32_t)bytes[1] << 8);
}

static uint32_t get32(const uint8_t *bytes)
{
    return get16(bytes) | (get16(bytes + 2) << 16);
}

static mck_real get_number(const uint8_t *bytes)
{
    mck_real value;
#ifdef MCK_FLOAT32
    const uint32_t bits = get32(bytes);
#else
    const uint64_t bits = (uint64_t)get32(bytes) | ((uint64_t)get32(bytes + 4) << 32);
#endif
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void put(writing *to, uint32_t value, int n_bytes)
{
    for (int i = 0; i < n_bytes && to->length < MCK_PAYLOAD - CHECK; i++) {
        to->bytes[to->length++] = (uint8_t)(value & 0xFFu);
        value >>= 8;
    }
}

static void put_numbers(writing *to, const mck_real *values, int n)
{
    for (int i = 0; i < n; i++) {
#ifdef MCK_FLOAT32
        uint32_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        put(to, bits, 4);
#else
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        put(to, (uint32_t)(bits & 0xFFFFFFFFu), 4);
        put(to, (uint32_t)(bits >> 32), 4);
#endif
    }
}

static void put_text(writing *to, const char *text)
{
    const uint32_t n = (uint32_t)strlen(text);
    put(to, n, 1);
    for (uint32_t i = 0; i < n; i++) {
        put(to, (uint8_t)text[i], 1);
    }
}

static void begin(const mck_server *self, writing *to, uint32_t kind, uint32_t sequence)
{
    to->length = 0;
    put(to, MCK_LINK_VERSION, 1);
    put(to, kind | ANSWER, 1);
    put(to, self->session, 4);
    put(to, sequence, 4);
}

/* Append the checksum, and stuff: no zero but at the end (COBS). */
static void finish(writing *from, mck_frame *to)
{
    const uint32_t check = crc32(from->bytes, from->length);
    for (int i = 0; i < CHECK; i++) {
        from->bytes[from->length++] = (uint8_t)((check >> (8 * i)) & 0xFFu);
    }
    int mark = 0;
    int at = 1;
    for (int i = 0; i < from->length; i++) {
        if (from->bytes[i] == 0u) {
            to->bytes[mark] = (uint8_t)(at - mark);
            mark = at;
        } else {
            to->bytes[at] = from->bytes[i];
        }
        at++;
    }
    to->bytes[mark] = (uint8_t)(at - mark);
    to->bytes[at++] = 0u;
    to->length = at;
    to->at = 0;
}

/* Undo the stuffing in place, and return the length; -1 where it is not stuffed so. */
static int unstuffed(uint8_t *bytes, int n)
{
    int at = 0;
    while (at < n) {
        const int next = at + bytes[at];
        if (next > n) {
            return -1;
        }
        if (at > 0) {
            bytes[at - 1] = 0u;
        }
        for (int i = at + 1; i < next; i++) {
            bytes[i - 1] = bytes[i];
        }
        at = next;
    }
    return n - 1;
}

static void make_safe(mck_server *self)
{
    const mck_channel *outputs = self->served->channels + self->served->n_inputs;
    for (int i = 0; i < self->served->n_outputs; i++) {
        self->out[i] = outputs[i].safe;
    }
    self->running = 0;
    self->every = 0;
    self->notes = 0;
}

static uint32_t notes(const mck_server *self)
{
    return (uint32_t)self->notes | (self->running ? NOTE_RUNNING : 0u) |
           (self->tripped ? NOTE_TRIPPED : 0u) | (self->lock_step ? NOTE_LOCK_STEP : 0u);
}

static void put_outputs(const mck_server *self, writing *to)
{
    put(to, notes(self), 1);
    put(to, self->steps, 4);
    put_numbers(to, self->out, self->served->n_outputs);
}

static void step(mck_server *self)
{
    const mck_channel *outputs = self->served->channels + self->served->n_inputs;
    const int status = self->served->step(self->model, self->in, self->out);
    self->steps++;
    self->notes = status == 0 ? 0u : (uint8_t)(status == 1 ? NOTE_BAD_INPUT : NOTE_BAD_OUTPUT);
    for (int i = 0; i < self->served->n_outputs; i++) {
        const mck_real limited = mck_min(mck_max(self->out[i], outputs[i].low), outputs[i].high);
        if (limited < self->out[i] || limited > self->out[i]) {
            self->notes |= (uint8_t)NOTE_LIMITED;
        }
        self->out[i] = limited;
    }
    self->since++;
    if (self->every != 0u && self->since >= self->every) {
        self->since = 0;
        if (self->sample.length == 0) {
            writing told;
            begin(self, &told, SAMPLE, self->sequence);
            put(&told, OK, 1);
            put_outputs(self, &told);
            put_numbers(&told, self->in, self->served->n_inputs);
            finish(&told, &self->sample);
        }
    }
}

static int within(mck_real value, mck_real low, mck_real high)
{
    return value >= low && value <= high; /* as NaN never is */
}

static uint8_t open_session(mck_server *self, uint32_t session, const uint8_t *body, int n)
{
    if (n != 13 || body[8] > 1u) {
        return MALFORMED;
    }
    if (memcmp(body, self->served->fingerprint, 8) != 0) {
        return OTHER_MODEL;
    }
    if (session - self->session == 0u || session - self->session >= HALF) {
        return OLD_SESSION;
    }
    const uint32_t silence = get32(body + 9);
    if (silence == 0u || silence > self->served->silence) {
        return BEYOND_LIMITS;
    }
    make_safe(self);
    self->session = session;
    self->silence = silence;
    self->lock_step = body[8];
    self->open = 1;
    self->tripped = 0;
    return OK;
}

static int missable(const mck_served *served, int input)
{
    return input >= served->n_inputs - served->n_missable;
}

static uint8_t take_inputs(mck_server *self, const uint8_t *body, int n)
{
    const mck_served *served = self->served;
    if (n != served->n_inputs * NUMBER) {
        return MALFORMED;
    }
    for (int i = 0; i < served->n_inputs; i++) {
        const mck_real value = get_number(body + i * NUMBER);
        if (!self->own[i] && !missable(served, i) &&
            !within(value, served->channels[i].low, served->channels[i].high)) {
            return BEYOND_LIMITS;
        }
    }
    for (int i = 0; i < served->n_inputs; i++) {
        if (!self->own[i]) {
            const mck_real value = get_number(body + i * NUMBER);
            const int there = within(value, served->channels[i].low, served->channels[i].high);
            self->in[i] = there ? value : (mck_real)NAN;
        }
    }
    self->running = 1;
    if (self->lock_step) {
        step(self);
    }
    return OK;
}

/* Carry out what changes something, once. */
static uint8_t carried_out(mck_server *self, uint8_t kind, const uint8_t *body, int n)
{
    if (kind == RELEASE || kind == KEEP || kind == RESET) {
        if (n != 0) {
            return MALFORMED;
        }
        if (kind == RELEASE) {
            make_safe(self);
            self->open = 0;
        } else if (kind == RESET) {
            self->served->reset(self->model);
        }
        return kind == KEEP && self->tripped ? IS_SAFE : OK;
    }
    if (self->tripped) {
        return IS_SAFE;
    }
    switch (kind) {
    case INPUTS:
        return take_inputs(self, body, n);
    case STREAM:
        if (n != 2) {
            return MALFORMED;
        }
        self->every = (uint16_t)get16(body);
        self->since = 0;
        return OK;
    default:
        return MALFORMED;
    }
}

static void identify(const mck_server *self, writing *to)
{
    const mck_served *served = self->served;
    put(to, OK, 1);
    put(to, sizeof(mck_real), 1);
    put(to, notes(self), 1);
    for (int i = 0; i < 8; i++) {
        put(to, served->fingerprint[i], 1);
    }
    put(to, served->period, 4);
    put(to, served->silence, 4);
    put(to, self->steps, 4);
    put(to, self->dropped, 4);
    put(to, (uint32_t)served->n_inputs, 2);
    put(to, (uint32_t)served->n_outputs, 2);
    put(to, (uint32_t)served->n_memory, 2);
    put(to, (uint32_t)served->n_missable, 2);
}

/* Answer what changes nothing. */
static void tell(const mck_server *self, writing *to, uint8_t kind, const uint8_t *body, int n)
{
    const mck_served *served = self->served;
    if (kind == IDENTIFY && n == 0) {
        identify(self, to);
    } else if (kind == STATE && n == 0) {
        put(to, OK, 1);
        put_outputs(self, to);
        put_numbers(to, self->in, served->n_inputs);
    } else if (kind == DESCRIBE && n == 1 && body[0] < served->n_inputs + served->n_outputs) {
        const mck_channel *channel = &served->channels[body[0]];
        put(to, OK, 1);
        put_numbers(to, &channel->low, 1);
        put_numbers(to, &channel->high, 1);
        put_numbers(to, &channel->safe, 1);
        put_text(to, channel->name);
        put_text(to, channel->unit);
    } else if (kind == READ && n == 3 && body[2] * NUMBER < ROOM &&
               (int)get16(body) + body[2] <= served->n_memory) {
        put(to, OK, 1);
        put_numbers(to, self->memory + get16(body), body[2]);
    } else {
        put(to, MALFORMED, 1);
    }
}

static void handle(mck_server *self, const uint8_t *frame, int length)
{
    const uint8_t kind = frame[1];
    const uint32_t session = get32(frame + 2);
    const uint32_t sequence = get32(frame + 6);
    const uint8_t *body = frame + HEAD;
    const int n = length - HEAD;
    writing to;
    if ((kind & ANSWER) != 0u || self->answer.length != 0) {
        self->dropped++; /* an echo; or what could not be answered, which is not carried out */
        return;
    }
    if (kind == IDENTIFY || kind == DESCRIBE || kind == STATE || kind == READ) {
        begin(self, &to, kind, sequence);
        tell(self, &to, kind, body, n);
        finish(&to, &self->answer);
        return;
    }
    const uint32_t ahead = sequence - self->sequence;
    uint8_t status;
    if (self->open && session == self->session && ahead == 0u) {
        if (kind != self->last_kind) {
            self->dropped++;
            return;
        }
        status = self->last_status; /* its answer was lost */
    } else if (kind == OPEN) {
        status = open_session(self, session, body, n);
        if (status == OK) {
            self->sequence = sequence;
            self->last_kind = kind;
            self->last_status = status;
            self->quiet = 0;
        }
    } else if (!self->open || session != self->session) {
        status = NO_SESSION;
    } else if (ahead >= HALF) {
        self->dropped++;
        return;
    } else {
        self->sequence = sequence;
        self->last_kind = kind;
        status = carried_out(self, kind, body, n);
        self->last_status = status;
        if (status == OK) {
            self->quiet = 0;
        }
    }
    begin(self, &to, kind, sequence);
    put(&to, status, 1);
    if (kind == INPUTS) {
        put_outputs(self, &to);
    }
    finish(&to, &self->answer);
}

void mck_server_init(mck_server *self, uint32_t start)
{
    self->session = (start & 0xFFFFu) << 16;
    self->sequence = 0;
    self->last_kind = 0;
    self->last_status = 0;
    self->open = 0;
    self->lock_step = 0;
    self->tripped = 0;
    self->silence = self->served->silence;
    self->quiet = 0;
    self->steps = 0;
    self->since = 0;
    self->dropped = 0;
    self->length = 0;
    self->too_long = 0;
    self->answer.length = 0;
    self->sample.length = 0;
    self->sending = NULL;
    for (int i = 0; i < self->served->n_inputs; i++) {
        self->in[i] = self->served->channels[i].low;
        self->own[i] = 0;
    }
    make_safe(self);
}

void mck_server_receive(mck_server *self, uint8_t byte)
{
    if (byte != 0u) {
        if (self->length < MCK_STUFFED - 1) {
            self->frame[self->length++] = byte;
        } else {
            self->too_long = 1;
        }
        return;
    }
    if (self->length > 0) {
        const int n = self->too_long ? -1 : unstuffed(self->frame, self->length);
        if (n >= HEAD + CHECK && self->frame[0] == MCK_LINK_VERSION &&
            crc32(self->frame, n - CHECK) == get32(self->frame + n - CHECK)) {
            handle(self, self->frame, n - CHECK);
        } else {
            self->dropped++;
        }
    }
    self->length = 0;
    self->too_long = 0;
}

int mck_server_send(mck_server *self)
{
    if (self->sending == NULL) {
        if (self->answer.length != 0) {
            self->sending = &self->answer;
        } else if (self->sample.length != 0) {
            self->sending = &self->sample;
        } else {
            return -1;
        }
    }
    mck_frame *frame = self->sending;
    const int byte = frame->bytes[frame->at++];
    if (frame->at == frame->length) {
        frame->length = 0;
        self->sending = NULL;
    }
    return byte;
}

void mck_server_tick(mck_server *self)
{
    if (self->open && !self->tripped) {
        self->quiet++;
        if (self->quiet > self->silence) {
            make_safe(self);
            self->tripped = 1;
        }
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
