#include "recurrent_fuzzy_network.h"

#define LEAST_FIRING MCK_EITHER(1e-290, 1e-35)

typedef struct {
    int n_out;
    int n_in;
    int n_scheduled; /* scheduling inputs */
    int n_late;      /* past samples of each */
    int sets;
    int n; /* regressors */
} structure;

static structure read_structure(const mck_part *part)
{
    structure s;
    s.n_out = (int)part->coefficients[0];
    s.n_in = (int)part->coefficients[1];
    s.n_late = (int)part->coefficients[2];
    s.sets = (int)part->coefficients[3];
    s.n_scheduled = part->n_inputs - 1;
    s.n = s.n_out + 1 + s.n_in + s.n_scheduled * (1 + s.n_late);
    return s;
}

/* Put a new sample in front of n past ones. */
static void push(mck_real *past, int n, mck_real sample)
{
    for (int k = n - 1; k > 0; k--) {
        past[k] = past[k - 1];
    }
    if (n > 0) {
        past[0] = sample;
    }
}

void mck_recurrent_fuzzy_network_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const structure s = read_structure(part);
    int at = 0;
    for (int k = 0; k < s.n_out + s.n_in; k++) {
        state[at++] = in[0];
    }
    for (int i = 0; i < s.n_scheduled; i++) {
        for (int k = 0; k < s.n_late; k++) {
            state[at++] = in[1 + i];
        }
    }
    while (at < part->n_states) {
        state[at++] = MCK_R(0.0);
    }
}

void mck_recurrent_fuzzy_network_step(const mck_part *part, mck_real *state, const mck_real *in,
                                      mck_real *out)
{
    const structure s = read_structure(part);
    const mck_real *centres = part->coefficients + 4;
    const mck_real *widths = centres + s.n * s.sets;
    const mck_real *feedbacks = widths + s.n * s.sets;
    const mck_real *consequent = feedbacks + s.n * s.sets;
    mck_real *past_in = state + s.n_out;
    mck_real *past_scheduled = past_in + s.n_in;
    mck_real *memberships = past_scheduled + s.n_scheduled * s.n_late;
    mck_real *x = state + part->n_states;
    int at = 0;
    for (int k = 0; k < s.n_out; k++) {
        x[at++] = state[k];
    }
    x[at++] = in[0];
    for (int k = 0; k < s.n_in; k++) {
        x[at++] = past_in[k];
    }
    for (int i = 0; i < s.n_scheduled; i++) {
        x[at++] = in[1 + i];
        for (int k = 0; k < s.n_late; k++) {
            x[at++] = past_scheduled[i * s.n_late + k];
        }
    }
    int n_rules = 1;
    for (int i = 0; i < s.n; i++) {
        n_rules *= s.sets;
        for (int k = 0; k < s.sets; k++) {
            const int place = i * s.sets + k;
            const mck_real z =
                (x[i] - centres[place] + feedbacks[place] * memberships[place]) / widths[place];
            memberships[place] = mck_exp(MCK_R(-0.5) * z * z);
        }
    }
    mck_real total = MCK_R(0.0);
    mck_real y = MCK_R(0.0);
    for (int rule = 0; rule < n_rules; rule++) {
        mck_real firing = MCK_R(1.0);
        int rest = rule;
        for (int i = s.n - 1; i >= 0; i--) {
            firing *= memberships[i * s.sets + rest % s.sets];
            rest /= s.sets;
        }
        mck_real answer = consequent[s.n];
        for (int i = 0; i < s.n; i++) {
            answer += consequent[i] * x[i];
        }
        total += firing;
        y += firing * answer;
        consequent += s.n + 1;
    }
    if (total > LEAST_FIRING) {
        y /= total;
    } else {
        y = s.n_out > 0 ? state[0] : MCK_R(0.0);
    }
    push(state, s.n_out, y);
    push(past_in, s.n_in, in[0]);
    for (int i = 0; i < s.n_scheduled; i++) {
        push(past_scheduled + i * s.n_late, s.n_late, in[1 + i]);
    }
    out[0] = y;
}
