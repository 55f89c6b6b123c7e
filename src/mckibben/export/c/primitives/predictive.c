#include "predictive.h"

#include "balance.h"
#include "gpi.h"
#include "pi.h"
#include "plan.h"
#include "plan_one.h"
#include "supply.h"

#define HEAD 11
#define STILL MCK_R(0.1)
#define PI_MODEL 0
#define GPI_MODEL 1

typedef void (*starter)(const mck_part *part, mck_real *state, const mck_real *in);
typedef void (*stepper)(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

/* How a model and its inverse run. */
typedef struct {
    stepper answer;
    starter begin;
    stepper undo;
} kind;

static const kind kinds[] = {
    {mck_pi_step, mck_pi_inverse_start, mck_pi_inverse_step},
    {mck_gpi_step, mck_gpi_inverse_start, mck_gpi_inverse_step},
    {mck_balance_inverse_step, mck_balance_start, mck_balance_step},
};

typedef struct {
    int which;
    int length;
    int n;
    int n_rows;
    int passes;
    int n_memory;
    mck_part model;
    mck_part inverse;
    const mck_real *nudges;
    const mck_real *lowest;
    const mck_real *rows;
    mck_real *memory;
    mck_real *wished;
    mck_real *before;
    mck_real *started;
    mck_real *planned;
    mck_real *trial;    /* the model's state, and its scratch */
    mck_real *undoing;  /* the inverse's */
    mck_real *kept;     /* the model's state before a sample, */
    mck_real *after;    /* and after it */
    mck_real *given;    /* inputs of the model or its inverse */
    mck_real *nudged;   /* pressures, and what they give */
    mck_real *inverted; /* pressures of the horizon: of the inverse, */
    mck_real *nominal;  /* those that a plan is made along, */
    mck_real *next;     /* and the plan */
    mck_real *errors;
    mck_real *slopes;
    mck_real *scratch;
} planner;

static void copy(int count, const mck_real *from, mck_real *to)
{
    for (int i = 0; i < count; i++) {
        to[i] = from[i];
    }
}

static planner planner_of(const mck_part *part, mck_real *state)
{
    const mck_real *c = part->coefficients;
    planner f;
    f.which = (int)c[0];
    f.length = (int)c[1];
    f.n = (int)c[2];
    f.n_rows = (int)c[3];
    f.n_memory = (int)c[4];
    f.passes = (int)c[10];
    const int count = f.length * f.n;
    const int n_undoing = (int)c[5];
    f.nudges = c + HEAD;
    f.lowest = f.nudges + f.n;
    f.rows = f.lowest + f.n;
    f.model.coefficients = f.rows + f.n_rows * (f.n + 2);
    f.model.n_coefficients = (int)c[6];
    f.model.n_states = f.n_memory;
    f.model.n_inputs = part->n_inputs;
    f.model.n_outputs = f.n;
    f.model.start = part->start;
    f.inverse = f.model;
    f.inverse.coefficients = f.model.coefficients + f.model.n_coefficients;
    f.inverse.n_coefficients = (int)c[7];
    f.inverse.n_states = n_undoing;
    f.memory = state;
    f.wished = f.memory + f.n_memory;
    f.before = f.wished + count;
    f.started = f.before + f.n;
    f.planned = f.started + 1;
    f.trial = f.planned + 1;
    f.undoing = f.trial + f.n_memory + (int)c[8];
    f.kept = f.undoing + n_undoing + (int)c[9];
    f.after = f.kept + f.n_memory;
    f.given = f.after + f.n_memory;
    f.nudged = f.given + part->n_inputs;
    f.inverted = f.nudged + 3 * f.n;
    f.nominal = f.inverted + count;
    f.next = f.nominal + count;
    f.errors = f.next + count;
    f.slopes = f.errors + count;
    f.scratch = f.slopes + count * f.n;
    return f;
}

/* The inverse's state that matches the model's. */
static void undo(const planner *f)
{
    copy(f->n_memory, f->memory, f->undoing);
    if (f->which == PI_MODEL || f->which == GPI_MODEL) {
        const int n = f->which == PI_MODEL ? f->n_memory : f->n_memory - 1;
        const mck_real *c = f->model.coefficients;
        const mck_real *w = c + (f->which == PI_MODEL ? 1 : 4) + n;
        mck_real output = MCK_R(0.0);
        for (int i = 0; i < n; i++) {
            output += w[i] * f->memory[i];
        }
        f->undoing[f->n_memory] = f->which == PI_MODEL ? c[0] + output : output;
        f->undoing[f->n_memory + 1] = MCK_R(0.0);
    }
}

/* What the model gives for pressures, from its trial state. */
static void answer(const planner *f, const mck_real *pressures, mck_real *given)
{
    copy(f->n, pressures, f->given);
    kinds[f->which].answer(&f->model, f->trial, f->given, given);
}

/* Clip pressures of the horizon to all limits, one after another; returns 1 if they kept to them. */
static int kept_to(const planner *f, mck_real *pressures)
{
    const mck_real *before = f->before;
    int there = 1;
    for (int t = 0; t < f->length; t++) {
        there &= mck_allowed(f->n, f->n_rows, f->rows, before, pressures + t * f->n);
        before = pressures + t * f->n;
    }
    return there;
}

/* Errors along pressures, and the model's slopes where the motion goes on. */
static void linearise(const planner *f, const mck_real *pressures)
{
    const int n = f->n;
    mck_real *given = f->nudged + n;
    mck_real *then = given + n;
    copy(f->n_memory, f->memory, f->kept);
    for (int t = 0; t < f->length; t++) {
        const mck_real *row = pressures + t * n;
        copy(f->n_memory, f->kept, f->trial);
        answer(f, row, given);
        copy(f->n_memory, f->trial, f->after);
        for (int k = 0; k < n; k++) {
            mck_real way = MCK_R(0.0); /* that of the last change */
            for (int s = t; s >= 0 && !(mck_abs(way) > STILL * f->nudges[k]); s--) {
                way = pressures[s * n + k] - (s > 0 ? pressures[(s - 1) * n + k] : f->before[k]);
            }
            const mck_real nudge = way < -STILL * f->nudges[k] ? -f->nudges[k] : f->nudges[k];
            copy(n, row, f->nudged);
            f->nudged[k] += nudge;
            copy(f->n_memory, f->kept, f->trial);
            answer(f, f->nudged, then);
            for (int i = 0; i < n; i++) {
                f->slopes[(t * n + i) * n + k] = (then[i] - given[i]) / nudge;
            }
        }
        for (int k = 0; k < n; k++) {
            f->errors[t * n + k] = f->wished[t * n + k] - given[k];
        }
        copy(f->n_memory, f->after, f->kept);
    }
}

/* Leave in `next` the pressures of the horizon that come nearest to the references, within limits. */
static void choose(const planner *f)
{
    copy(f->length * f->n, f->inverted, f->nominal);
    for (int pass = 0; pass < f->passes; pass++) {
        if (pass > 0) {
            copy(f->length * f->n, f->next, f->nominal);
        }
        linearise(f, f->nominal);
        if (f->n == 1) {
            mck_plan_one(f->length, f->n_rows, f->rows, f->before[0], f->slopes, f->nominal,
                         f->errors, f->next, f->scratch);
        } else {
            (void)mck_plan(f->length, f->n, f->n_rows, f->rows, f->before, f->slopes, f->nominal,
                           f->errors, f->next, f->scratch);
        }
        (void)kept_to(f, f->next);
    }
}

void mck_predictive_start(const mck_part *part, mck_real *state, const mck_real *in)
{
    const planner f = planner_of(part, state);
    kinds[f.which].begin(&f.inverse, f.undoing, in);
    copy(f.n_memory, f.undoing, f.memory);
    for (int i = f.n_memory; i < part->n_states; i++) {
        state[i] = MCK_R(0.0);
    }
}

void mck_predictive_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out)
{
    const planner f = planner_of(part, state);
    const int n = f.n;
    const int first = !(*f.started > MCK_R(0.0));
    copy(part->n_inputs, in, f.given);
    for (int t = 0; t < f.length; t++) {
        const int due = t + 1 < f.length && !first;
        copy(n, due ? f.wished + (t + 1) * n : in, f.wished + t * n);
    }
    undo(&f);
    for (int t = 0; t < f.length; t++) {
        copy(n, f.wished + t * n, f.given);
        kinds[f.which].undo(&f.inverse, f.undoing, f.given, f.inverted + t * n);
    }
    if (first) {
        copy(n, f.inverted, f.before);
        for (int i = 0; i < f.n_rows; i++) {
            if (!(f.rows[i * (n + 2)] > MCK_R(0.0))) {
                (void)mck_allowed(n, 1, f.rows + i * (n + 2), f.lowest, f.before);
            }
        }
        *f.started = MCK_R(1.0);
    }
    copy(f.length * n, f.inverted, f.next);
    if (!kept_to(&f, f.next)) {
        choose(&f);
        *f.planned += MCK_R(1.0);
    }
    copy(n, f.next, f.before);
    copy(f.n_memory, f.memory, f.trial);
    answer(&f, f.before, f.nudged + n);
    copy(f.n_memory, f.trial, f.memory);
    copy(n, f.before, out);
}
