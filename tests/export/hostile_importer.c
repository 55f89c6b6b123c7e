/* An importer that calls an FMU with what it should not: prints the line of the first call that is not
 * refused as it should be. Built with -DFMI=2 or -DFMI=3, and under sanitizers where there are any. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "unit_model.h"

#if FMI == 2
#include "fmi2Functions.h"
typedef fmi2Component instance;
#define OK fmi2OK
#define ERROR fmi2Error
#define WARNING fmi2Warning
static instance new_one(const char *token)
{
    return fmi2Instantiate("x", fmi2CoSimulation, token, NULL, NULL, 0, 0);
}
#define free_one fmi2FreeInstance
static int start(instance c, double time)
{
    return fmi2SetupExperiment(c, 0, 0.0, time, 0, 0.0) == OK ? fmi2EnterInitializationMode(c) : ERROR;
}
#define started fmi2ExitInitializationMode
#define end fmi2Terminate
#define reset fmi2Reset
#define set(c, vr, n, values) fmi2SetReal(c, vr, n, values)
#define get(c, vr, n, values) fmi2GetReal(c, vr, n, values)
#define get_status(c, vr, n, values) fmi2GetInteger(c, vr, n, values)
#define step(c, time, h) fmi2DoStep(c, time, h, 1)
#define get_state fmi2GetFMUstate
#define set_state fmi2SetFMUstate
#define free_state fmi2FreeFMUstate
#define state_size fmi2SerializedFMUstateSize
#define to_bytes fmi2SerializeFMUstate
#define from_bytes fmi2DeSerializeFMUstate
#else
#include "fmi3Functions.h"
typedef fmi3Instance instance;
#define OK fmi3OK
#define ERROR fmi3Error
#define WARNING fmi3Warning
static instance new_one(const char *token)
{
    return fmi3InstantiateCoSimulation("x", token, NULL, 0, 0, 0, 0, NULL, 0, NULL, NULL, NULL);
}
#define free_one fmi3FreeInstance
static int start(instance c, double time)
{
    return fmi3EnterInitializationMode(c, 0, 0.0, time, 0, 0.0);
}
#define started fmi3ExitInitializationMode
#define end fmi3Terminate
#define reset fmi3Reset
#define set(c, vr, n, values) fmi3SetFloat64(c, vr, n, values, n)
#define get(c, vr, n, values) fmi3GetFloat64(c, vr, n, values, n)
#define get_status(c, vr, n, values) fmi3GetInt32(c, vr, n, values, n)
static int step(instance c, double time, double h)
{
    fmi3Boolean event, terminate, early;
    double last;
    return fmi3DoStep(c, time, h, 1, &event, &terminate, &early, &last);
}
#define get_state fmi3GetFMUState
#define set_state fmi3SetFMUState
#define free_state fmi3FreeFMUState
#define state_size fmi3SerializedFMUStateSize
#define to_bytes fmi3SerializeFMUState
#define from_bytes fmi3DeserializeFMUState
#endif

#define MUST(holds)                           \
    if (!(holds)) {                           \
        printf("line %d: %s\n", __LINE__, #holds); \
        exit(1);                              \
    }

static const double odd[] = {NAN, INFINITY, -INFINITY, 1e308, -1e308, 5e-324, -1.0, 0.0, 1e300};
#define N_ODD (sizeof odd / sizeof *odd)

static unsigned chance(void)
{
    static unsigned long long now = 1;
    now = now * 6364136223846793005ull + 1442695040888963407ull;
    return (unsigned)(now >> 33);
}

static const unsigned input = 0, output = UNIT_N_INPUTS, status = UNIT_N_INPUTS + UNIT_N_OUTPUTS;

static instance running(void)
{
    instance c = new_one(UNIT_TOKEN);
    MUST(c != NULL && start(c, 0.0) == OK && started(c) == OK);
    return c;
}

static void calls_without_anything(instance c)
{
    double value = 0.0;
    size_t size = 0;
    int found = 0;
    void *kept = NULL;
    free_one(NULL);
    MUST(new_one(NULL) == NULL && new_one("") == NULL);
    MUST(start(NULL, 0.0) == ERROR && started(NULL) == ERROR && end(NULL) == ERROR);
    MUST(reset(NULL) == ERROR && step(NULL, 0.0, 0.01) == ERROR);
    MUST(set(NULL, &input, 1, &value) == ERROR && get(NULL, &input, 1, &value) == ERROR);
    MUST(set(c, NULL, 1, &value) == ERROR && get(c, NULL, 1, &value) == ERROR);
    MUST(set(c, &input, 1, NULL) == ERROR && get(c, &input, 1, NULL) == ERROR);
    MUST(set(c, NULL, 0, NULL) == OK && get(c, NULL, 0, NULL) == OK);
    MUST(get_status(NULL, &status, 1, &found) == ERROR);
    MUST(get_status(c, NULL, 1, &found) == ERROR && get_status(c, &status, 1, NULL) == ERROR);
    MUST(get_state(NULL, &kept) == ERROR && get_state(c, NULL) == ERROR);
    MUST(set_state(NULL, NULL) == ERROR && set_state(c, NULL) == ERROR);
    MUST(free_state(c, NULL) == OK && free_state(c, &kept) == OK);
    MUST(state_size(c, NULL, NULL) == ERROR && state_size(c, NULL, &size) == OK && size > 0);
    MUST(to_bytes(c, NULL, NULL, size) == ERROR && from_bytes(c, NULL, size, &kept) == ERROR);
#if FMI == 2
    fmi2Status told;
    MUST(fmi2GetStatus(NULL, fmi2DoStepStatus, &told) == ERROR);
    MUST(fmi2GetStatus(c, fmi2DoStepStatus, NULL) == ERROR);
    MUST(fmi2GetRealStatus(NULL, fmi2LastSuccessfulTime, &value) == ERROR);
    MUST(fmi2GetRealStatus(c, fmi2LastSuccessfulTime, NULL) == ERROR);
#else
    MUST(fmi3DoStep(c, 0.0, 0.01, 1, NULL, NULL, NULL, NULL) == ERROR);
    MUST(fmi3GetFloat64(c, &input, 1, &value, 2) == ERROR);
    MUST(fmi3SetFloat64(c, &input, 1, &value, 0) == ERROR);
    MUST(fmi3GetInt32(c, &status, 1, &found, 2) == ERROR);
#endif
}

static void strange_tokens(void)
{
    const size_t n = 50u << 20;
    char *token = malloc(n);
    memset(token, '{', n);
    token[n - 1] = '\0';
    MUST(new_one(token) == NULL);
    free(token);
}

static void variables_that_are_not(instance c)
{
    double value = 1.0;
    int found = 0;
    const unsigned outside[] = {output, status, status + 1, status + 2, 1u << 31, ~0u};
    for (size_t i = 0; i < sizeof outside / sizeof *outside; i++) {
        MUST(set(c, &outside[i], 1, &value) == ERROR);
        MUST(i < 3 || get(c, &outside[i], 1, &value) == ERROR);
        MUST(outside[i] == status || get_status(c, &outside[i], 1, &found) == ERROR);
    }
}

static void calls_out_of_order(void)
{
    double value = 1.0;
    instance c = new_one(UNIT_TOKEN);
    MUST(step(c, 0.0, 0.01) == ERROR && started(c) == ERROR && end(c) == ERROR);
    for (size_t i = 0; i < 3; i++) {
        MUST(start(c, odd[i]) == ERROR); /* at no time */
    }
    MUST(start(c, 1.0) == OK && start(c, 2.0) == ERROR && step(c, 1.0, 0.01) == ERROR);
    MUST(started(c) == OK && started(c) == ERROR && start(c, 0.0) == ERROR);
    MUST(step(c, 1.0, 0.01) == OK && end(c) == OK && end(c) == ERROR);
    MUST(step(c, 1.01, 0.01) == ERROR && set(c, &input, 1, &value) == ERROR);
    MUST(get(c, &output, 1, &value) == OK);
    MUST(reset(c) == OK && start(c, 0.0) == OK && started(c) == OK && step(c, 0.0, 0.01) == OK);
    free_one(c);
}

static void odd_times(instance c)
{
    for (size_t i = 0; i < N_ODD; i++) {
        MUST(odd[i] == 5e-324 || step(c, 0.0, odd[i]) == ERROR);
        MUST(i > 3 || step(c, odd[i], 0.01) == ERROR || isfinite(odd[i]));
    }
    double value;
    MUST(step(c, 0.0, 0.01) == OK && get(c, &output, 1, &value) == OK && isfinite(value));
}

static void odd_values(void)
{
    instance c = running();
    double good = 1.0, before, after;
    int found;
    MUST(set(c, &input, 1, &good) == OK && step(c, 0.0, 0.01) == OK);
    MUST(get(c, &output, 1, &before) == OK);
    for (size_t i = 0; i < 3; i++) { /* told, and without effect */
        MUST(set(c, &input, 1, &odd[i]) == OK && step(c, 0.01 * (double)(i + 1), 0.01) == WARNING);
        MUST(get_status(c, &status, 1, &found) == OK && found == 1);
        MUST(get(c, &output, 1, &after) == OK && after == before);
    }
    for (int k = 4; k < 400; k++) {
        MUST(set(c, &input, 1, &odd[chance() % N_ODD]) == OK);
        MUST(step(c, 0.01 * k, 0.01) != ERROR);
        MUST(get(c, &output, 1, &after) == OK && isfinite(after));
    }
    free_one(c);
}

static void hostile_states(void)
{
    instance c = running();
    size_t size = 0;
    void *kept = NULL, *again = NULL;
    double value = 1.0;
    for (int k = 0; k < 5; k++) {
        value = (double)(chance() % 500) / 100.0;
        MUST(set(c, &input, 1, &value) == OK && step(c, 0.01 * k, 0.01) == OK);
    }
    MUST(get_state(c, &kept) == OK && state_size(c, kept, &size) == OK);
    char *bytes = malloc(size + 1), *damaged = malloc(size + 9);
    MUST(to_bytes(c, kept, bytes, size - 1) == ERROR && to_bytes(c, kept, bytes, size) == OK);
    MUST(from_bytes(c, bytes, size - 1, &again) == ERROR && from_bytes(c, bytes, 0, &again) == ERROR);
    MUST(from_bytes(c, bytes, size + 1, &again) == ERROR && again == NULL);
    MUST(from_bytes(c, bytes, size, &again) == OK && set_state(c, again) == OK);
    for (int attempt = 0; attempt < 3000; attempt++) {
        char *shifted = damaged + attempt % 8; /* not aligned */
        memcpy(shifted, bytes, size);
        for (unsigned n = chance() % 20; n > 0; n--) {
            const size_t at = chance() % (size / 8) * 8;
            const double number = chance() % 2 ? odd[chance() % N_ODD] : (double)chance() - 1e9;
            if (chance() % 3) {
                memcpy(shifted + at, &number, 8);
            } else {
                shifted[chance() % size] = (char)chance();
            }
        }
        if (from_bytes(c, shifted, size, &again) != OK || set_state(c, again) != OK) {
            continue;
        }
        for (int k = 0; k < 5; k++) {
            double time = 0.0;
            value = (double)(chance() % 500) / 100.0;
            (void)set(c, &input, 1, &value);
#if FMI == 2
            (void)fmi2GetRealStatus(c, fmi2LastSuccessfulTime, &time);
#else
            const unsigned its_time = status + 1;
            (void)get(c, &its_time, 1, &time);
#endif
            (void)step(c, time, 0.01);
            (void)get(c, &output, 1, &value);
        }
    }
    MUST(set_state(c, kept) == OK && step(c, 0.05, 0.01) == OK);
    MUST(get(c, &output, 1, &value) == OK && isfinite(value));
    (void)free_state(c, &kept);
    (void)free_state(c, &again);
    free(bytes);
    free(damaged);
    free_one(c);
}

int main(void)
{
    instance c = running();
    calls_without_anything(c);
    variables_that_are_not(c);
    odd_times(c);
    free_one(c);
    strange_tokens();
    calls_out_of_order();
    odd_values();
    hostile_states();
    return 0;
}
