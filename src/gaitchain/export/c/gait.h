/* A walk of ${robot} from its gait library. Written by gaitchain ${version}.
 *
 * C99, doubles, no allocation, no I/O, no clock, nothing global that changes: one gait_walker is one robot.
 * Compile without -ffast-math and -Ofast, which gait.c refuses: it needs NaN, and doubles of 64 bits.
 *
 *     static gait_walker walker;
 *     gait_start(&walker);
 *     every ${period_ms} ms: fill a gait_sensors; gait_step(&walker, &sensors, &targets); send targets.position
 *     whenever: gait_set_command(&walker, &command)
 *
 * Joints are those of gait_joint_names, in that order. Angles in rad, lengths in m, times in s. The trunk's frame
 * has x ahead, y left, z up; the accelerometer of a robot at rest shows +9.81 along z.
 */
#ifndef GAIT_H
#define GAIT_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GAIT_JOINTS ${joints}
#define GAIT_PERIOD_S ${period_s} /* between two calls of gait_step */
#define GAIT_REST_S ${rest_s} /* to stand before the first command, so that the vertical is learned */

/* What the walk is asked to do; all three speeds 0 stop. */
typedef struct {
    double vx; /* ahead [m/s], ${least_vx} to ${most_vx} */
    double vy; /* to the left [m/s], ${least_vy} to ${most_vy} */
    double yaw_rate; /* to the left [rad/s], ${least_yaw} to ${most_yaw} */
    double crouch; /* hips below their usual height [m], up to ${most_crouch} */
} gait_command;

/* What the robot measured in this period. */
typedef struct {
    double time; /* of the measurement, from any moment on [s] */
    double joint_position[GAIT_JOINTS]; /* [rad] */
    double joint_velocity[GAIT_JOINTS]; /* [rad/s] */
    double angular_velocity[3]; /* gyro, trunk's frame [rad/s] */
    double acceleration[3]; /* accelerometer, trunk's frame [m/s^2] */
    bool has_foot_load;
    double foot_load[2]; /* on the left and the right sole, where has_foot_load [N] */
} gait_sensors;

enum {
    GAIT_SENSOR_REPLACED = 1, /* a measurement was no number, absurd or a jump: the last good one was used */
    GAIT_TARGET_CLAMPED = 2, /* a target was outside its joint's range */
    GAIT_TARGETS_HELD = 4 /* a target was no number: the last ones were used */
};

/* What the joints are asked to do. */
typedef struct {
    double position[GAIT_JOINTS]; /* for position servos, ahead of the reference by what they lag [rad] */
    /* The same for motor drivers that push with
     * torque + gait_stiffness (reference - q) + gait_damping (velocity - q'): */
    double reference[GAIT_JOINTS]; /* [rad] */
    double velocity[GAIT_JOINTS]; /* [rad/s] */
    double torque[GAIT_JOINTS]; /* [N m] */
    unsigned status; /* 0, or a sum of GAIT_SENSOR_REPLACED and so on */
} gait_targets;

/* Where the robot is by its own steps, from where it stood at the start; it drifts. */
typedef struct {
    double x, y; /* [m] */
    double yaw; /* to the left [rad] */
} gait_place;

extern const char *const gait_joint_names[GAIT_JOINTS];
extern const double gait_stand[GAIT_JOINTS]; /* angles of the standing pose [rad] */
extern const double gait_stiffness[GAIT_JOINTS]; /* of motor drivers [N m/rad] */
extern const double gait_damping[GAIT_JOINTS]; /* [N m s/rad] */
${held}
/* Parts of the state. They are read and written by gait.c alone. */
${structs}
typedef struct {
    double bias[3]; /* of the gyro */
    gait_planar slope;
    double ticks; /* control periods of standing that an average is over */
    bool still;
    bool smoothed;
    double smooth[6]; /* accelerometer and gyro */
    int unlooked, unweighed;
} gait_estimator;

typedef struct {
    int layer, pose, first, target;
    bool left_support;
    double asked[3], owed[3], missed[3], landing[3];
} gait_chain;

typedef struct {
    gait_walk walk;
    gait_memory memory;
    gait_estimator estimator;
    gait_chain chain;
    gait_command command;
    gait_sensors good; /* the last sound measurements */
    double gyro[3]; /* the last one, believed or not */
    gait_place feet[2];
    double targets[GAIT_JOINTS]; /* the latest ones, before they are checked */
    double kept[GAIT_JOINTS]; /* the latest checked ones */
    double made[3]; /* the step just made: ahead, left, turn */
    double unrest, own_off, carried_out, room, usual_error, usual_slip, foot_heading;
    long steps, ticks; /* begun; control periods since the latest began */
    bool targets_known, step_made, has_good, load_known;
} gait_walker;

/* Stand upright without a command. */
void gait_start(gait_walker *walker);

/* Stand as after gait_start, but keep the command. */
void gait_reset(gait_walker *walker);

/* Set the command for all steps from the next one on; return it as it was clamped to what the library walks. */
gait_command gait_set_command(gait_walker *walker, const gait_command *command);

/* Compute the targets of one control period. */
void gait_step(gait_walker *walker, const gait_sensors *sensors, gait_targets *targets);

/* Whether the robot stands still with its feet side by side. */
bool gait_standing(const gait_walker *walker);

/* How much of the command's speeds the latest step carries out: less than 1 after a disturbance or in a crouch. */
double gait_carried_out(const gait_walker *walker);

/* Where the robot is. */
gait_place gait_where(const gait_walker *walker);

#ifdef __cplusplus
}
#endif

#endif
