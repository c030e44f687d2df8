/* A control loop at 1 kHz that slows down near singular configurations and stops before one.
 *
 * The header comes from pinsing, and is all that this needs:
 *
 *     pinsing export ur5 -o ur5_guard.h
 *     make run
 *
 * A UR5 turns its wrist towards q5 = 0 while its shoulder swings. Each tick asks the guard for the
 * proven distance to the nearest singular configuration and scales the joint speeds by it.
 */
#define _POSIX_C_SOURCE 199309L

#include <stdio.h>
#include <time.h>

#include "ur5_guard.h"

#define WARN 0.20 /* radians: slow down from here */
#define STOP 0.05 /* radians: stand still from here */

static double scale(double clearance)
{
    double share = (clearance - STOP) / (WARN - STOP);
    if (share < 0.0) {
        share = 0.0;
    }
    return (share > 1.0) ? 1.0 : share;
}

int main(void)
{
    const double period = 1e-3;
    const struct timespec tick = {0, 1000000};
    double q[UR5_JOINTS] = {0.0, -1.2, 1.3, -1.0, 0.8, 0.0};
    const double wish[UR5_JOINTS] = {0.3, 0.0, 0.0, 0.0, -0.8, 0.0};
    double least = HUGE_VAL;
    int slow = 0;

    if (UR5_COMPLETE == 0) {
        puts("families are missing: this guard finds nothing clear");
        return 2;
    }
    for (int i = 0; i < 2000; i++) {
        int family = -1;
        const double clearance = ur5_clearance(q, &family);
        const double share = scale(clearance);
        if (clearance < least) {
            least = clearance;
        }
        if (share < 1.0) {
            if (slow == 0) {
                printf("%.3f s: %.4f rad from %s, slowing down\n", (double)i * period, clearance,
                       ur5_family_text[family]);
            }
            slow++;
        }
        for (int j = 0; j < UR5_JOINTS; j++) {
            q[j] += share * wish[j] * period;
        }
        (void)nanosleep(&tick, NULL);
    }
    printf("%d of 2000 ticks slowed down, nearest %.4f rad, q5 = %.4f\n", slow, least, q[4]);
    return (least > 0.0) ? 0 : 1;
}
