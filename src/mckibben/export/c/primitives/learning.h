/* Recursive least squares that forget by excitation: p parameters learnt from one measured output.
 *
 * The covariance is kept as U D U', D first, then the columns of U above its diagonal of ones. */
#ifndef MCK_LEARNING_H
#define MCK_LEARNING_H

#include "mck.h"

/* What is remembered of a sensor. */
enum {
    MCK_READY,    /* 0 before it was read, then whose variance is bounded next */
    MCK_USUAL,    /* usual size of errors */
    MCK_SURPRISE, /* mean square of late errors, by their expected size */
    MCK_LAST,     /* last measured */
    MCK_THEN,     /* what was asked for when that changed */
    MCK_RELATED,  /* mean product of errors that follow one another */
    MCK_SQUARED,  /* mean square of errors */
    MCK_BEFORE,   /* last error */
    MCK_IGNORED,  /* measurements that were absent, stood still or were too far off */
    MCK_STOOD,    /* square of the scatter that the covariance stands by */
    MCK_HELPED,   /* mean product of what the fit lacks and what is made up for */
    MCK_APART,    /* mean square of what is made up for, and of the noise */
    MCK_SENSES
};

#define MCK_GATE MCK_R(3.0) /* expected errors beyond which an error weighs less */

typedef struct {
    int p;
    mck_real share;         /* sample time by the time to learn in */
    mck_real noise;         /* of the output */
    mck_real part;          /* one by how many outputs are measured */
    const mck_real *scales; /* of the parameters */
    const mck_real *widest; /* variances that are not passed */
    const mck_real *fitted; /* parameters at the start */
    const mck_real *fresh;  /* covariance at the start */
    const mck_real *family; /* numbers behind, of what learns */
} mck_learner;

typedef struct {
    mck_real *theta; /* as far as learnt */
    mck_real *used;  /* what the inverse runs with */
    mck_real *root;  /* covariance */
    mck_real *sense; /* MCK_SENSES numbers for each output */
    mck_real *work;  /* 3 p numbers behind the memory: slopes, then two to compute in */
} mck_learnt;

/* Numbers: p, share, noise, part, scales, widest, fitted, fresh, then the family's. */
mck_learner mck_read_learner(const mck_real *c);

/* Parts of the memory behind `own` numbers of the inverse; `outputs` are measured. */
mck_learnt mck_split_learnt(const mck_learner *m, mck_real *state, int own, int outputs);

void mck_learnt_start(const mck_learner *m, const mck_learnt *s, int outputs);

/* Learn from one output, whose slopes are the first p numbers of s->work; `predicted` is the output by
 * theta, `asked` by what is used, `fitted` by what was fitted. Returns whether anything was learnt. */
int mck_learn(const mck_learner *m, const mck_learnt *s, mck_real *sense, mck_real measured,
              mck_real predicted, mck_real asked, mck_real fitted);

/* How far from fitted to learnt errors would have been least, of all outputs. */
mck_real mck_trusted(const mck_learnt *s, int outputs);

#endif
