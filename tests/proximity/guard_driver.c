/* Reads configurations from a guard's user and asks the guard of each: compiled by test_guard.py
 * with GUARD_HEADER and PREFIX defined. */
#include GUARD_HEADER

#define JOIN_(a, b) a##_##b
#define JOIN(a, b) JOIN_(a, b)
#define CALL(name) JOIN(PREFIX, name)

#ifdef __cplusplus
extern "C" {
#endif
void ask(int count, const double *q, double *lower, int *nearest, double *each);
void equations(int count, const double *q, double *out);
const char *joint_name(int i);
const char *family_text(int i);
int clear(const double *q, double radius);
int inside(const double *q);
#ifdef ZONED
void in_zones(int count, const double *q, int *out);
#endif

/* each: (count, FAMILIES, 2 + JOINTS): f, lower, gradient */
void ask(int count, const double *q, double *lower, int *nearest, double *each)
{
    for (int i = 0; i < count; i++) {
        const double *const here = &q[i * JOINTS_];
        lower[i] = CALL(known_clearance)(here, &nearest[i]);
        for (int f = 0; f < FAMILIES_; f++) {
            double *const out = &each[(i * FAMILIES_ + f) * (2 + JOINTS_)];
            if (CALL(family)(f, here, &out[0], &out[2], &out[1]) == 0) {
                out[0] = -1.0;
            }
        }
    }
}

/* out: (count, EQUATIONS, 1 + JOINTS): value, gradient */
void equations(int count, const double *q, double *out)
{
    for (int i = 0; i < count; i++) {
        for (int e = 0; e < EQUATIONS_; e++) {
            double *const here = &out[(i * EQUATIONS_ + e) * (1 + JOINTS_)];
            here[0] = CALL(equation)(e, &q[i * JOINTS_], &here[1]);
        }
    }
}

const char *joint_name(int i) { return CALL(joint_name)[i]; }
const char *family_text(int i) { return CALL(family_text)[i]; }
int clear(const double *q, double radius) { return CALL(is_clear)(q, radius); }
int inside(const double *q) { return CALL(within_limits)(q); }
#ifdef ZONED
void in_zones(int count, const double *q, int *out)
{
    for (int i = 0; i < count; i++) {
        out[i] = CALL(in_zones)(&q[i * JOINTS_]);
    }
}
#endif
#ifdef __cplusplus
}
#endif
