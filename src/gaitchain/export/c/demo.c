/* Tries gait.c on this computer: times and sizes. Written by gaitchain ${version}.
 *
 *     cc -std=c99 -O2 gait.c demo.c -lm -o demo && ./demo
 *
 * It walks with servos that do at once what they are asked, on a trunk that does not tip: no robot and no physics,
 * but each line of code that a robot's period runs. Where there is no clock(), give another one below.
 */
#include "gait.h"

#include <stdio.h>
#include <time.h>

#define PERIODS 6000

static gait_walker walker;
static gait_sensors sensors;
static gait_targets targets;

static double now_us(void) { return 1e6 * (double)clock() / CLOCKS_PER_SEC; }

static void command_at(int period) {
    static const gait_command commands[] = {
        {0.0, 0.0, 0.0, 0.0}, {0.5 * ${most_vx}, 0.0, 0.0, 0.0}, {0.0, 0.5 * ${most_vy}, 0.0, 0.0},
        {0.3 * ${most_vx}, 0.0, 0.5 * ${most_yaw}, 0.0}, {0.5 * ${least_vx}, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
    const int count = (int)(sizeof commands / sizeof commands[0]);
    if (period % (PERIODS / count) == 0) {
        gait_set_command(&walker, &commands[period / (PERIODS / count) % count]);
    }
}

int main(void) {
    double all = 0.0, deciding = 0.0, largest = 0.0;
    int period, joint, decisions = 0;
    gait_start(&walker);
    for (joint = 0; joint < GAIT_JOINTS; joint++) {
        sensors.joint_position[joint] = gait_stand[joint];
    }
    sensors.acceleration[2] = 9.81;
    for (period = 0; period < PERIODS; period++) {
        const long steps = walker.steps;
        double since_us;
        command_at(period);
        since_us = now_us();
        gait_step(&walker, &sensors, &targets);
        since_us = now_us() - since_us;
        all += since_us;
        largest = since_us > largest ? since_us : largest;
        if (walker.steps > steps) {
            deciding += since_us;
            decisions++;
        }
        sensors.time += GAIT_PERIOD_S;
        for (joint = 0; joint < GAIT_JOINTS; joint++) {
            const double moved = targets.position[joint] - sensors.joint_position[joint];
            sensors.joint_velocity[joint] = moved / GAIT_PERIOD_S;
            sensors.joint_position[joint] = targets.position[joint];
        }
    }
    printf("periods: %d, %.2f us each, at most %.1f us\n", PERIODS, all / PERIODS, largest);
    printf("periods that choose a step: %d, %.2f us each\n", decisions, decisions ? deciding / decisions : 0.0);
    printf("state: %lu bytes, a period's sensors and targets: %lu bytes\n", (unsigned long)sizeof walker,
        (unsigned long)(sizeof sensors + sizeof targets));
    return walker.steps > 0 ? 0 : 1;
}
