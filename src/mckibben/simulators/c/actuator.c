/* Muscles of exported C as MuJoCo's bias callback: see mckibben.simulators.mujoco for what it keeps. */
#include <string.h>

#include <mujoco/mujoco.h>

#define MOST 256
#define HEAD 2
#define NOTHING 0.0
#define FIRST 1.0
#define KEPT 2.0

typedef void (*start_function)(void *self);
typedef int (*step_function)(void *self, const double *in, double *out);

typedef struct {
    start_function start;
    step_function step;
    int size; /* of a memory, in numbers */
    int along, pressure, shortening, pulls_only;
    double share, zero, time_step;
} muscle;

static muscle muscles[MOST];

int mck_muscle(int number, const muscle *given);
mjtNum mck_bias(const mjModel *m, const mjData *d, int actuator);

int mck_muscle(int number, const muscle *given)
{
    if (number < 0 || number >= MOST) {
        return 0;
    }
    muscles[number] = *given;
    return 1;
}

mjtNum mck_bias(const mjModel *m, const mjData *d, int actuator)
{
    const mjtNum *told = m->actuator_biasprm + (size_t)actuator * mjNBIAS;
    const int number = (int)told[0];
    if (number < 0 || number >= MOST || !muscles[number].step) {
        return 0.0;
    }
    const muscle *self = muscles + number;
    if (m->opt.integrator == mjINT_RK4 || m->opt.timestep != self->time_step) {
        mju_error("muscles in C keep the time step that they were compiled for, and not with RK4");
        return 0.0;
    }
    const int act = m->actuator_actadr[actuator];
    mjtNum pressure = act >= 0 ? d->act[act] : d->ctrl[actuator];
    if (act < 0 && m->actuator_ctrllimited[actuator]) {
        pressure = mju_clip(pressure, m->actuator_ctrlrange[2 * actuator],
                            m->actuator_ctrlrange[2 * actuator + 1]);
    }
    const double moved = 1000.0 * (d->actuator_length[actuator] - self->zero);
    double in[2], out[1];
    in[self->along] = self->shortening ? -moved : moved;
    in[self->pressure] = pressure;

    mjtNum *memory = d->userdata + (size_t)told[1];
    mjtNum *past = memory + HEAD, *now = past + self->size;
    const size_t bytes = sizeof(mjtNum) * (size_t)self->size;
    if (memory[0] != NOTHING && d->time > memory[1]) {
        memcpy(past, now, bytes);
        memory[0] = KEPT;
    } else if (memory[0] != KEPT) {
        self->start(past);
        memory[0] = FIRST;
    }
    memory[1] = d->time;
    memcpy(now, past, bytes);
    self->step(now, in, out);
    const double force = self->share * out[0];
    return self->pulls_only && force < 0.0 ? 0.0 : -force;
}
