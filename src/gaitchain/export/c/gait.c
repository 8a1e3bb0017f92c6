/* A walk of ${robot} from its gait library. Written by gaitchain ${version}.
 *
 * Three parts: tables of the library and its robot; what computes a control period, translated from gaitchain's
 * Python; and the runner: standing, choice of steps, estimation, checks. Comments name the Python it is made of.
 */
#include "gait.h"

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#if !defined(NAN) || DBL_MANT_DIG != 53
#error "needs IEEE numbers: NAN, and double with 64 bits"
#endif
/* NaN is what is not known yet, or no measurement; such flags let a compiler take it for a number. */
#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "compile without -ffast-math, -Ofast and -ffinite-math-only: the code needs NaN"
#endif

${structs}
/* ---- Constants and tables */

${constants}
${tables}
/* ---- Translated */

static double squared(double x) { return x * x; }
static double lesser(double a, double b) { return b < a ? b : a; }
static double greater(double a, double b) { return b > a ? b : a; }

${functions}
/* ---- Runner */

/* gaitchain.walker.gait.Gait */

static bool stops(const gait_command *command) {
    const double sizes = fabs(command->vx) + fabs(command->vy) + fabs(command->yaw_rate);
    return !(sizes > 0.0 && sizes < ABSURD);
}

/* gaitchain.gait.command_range.CommandRange */

static double part_of_range(double value, const double *ends) {
    const double most = value > 0.0 ? ends[1] : -ends[0];
    if (value == 0.0) {
        return 0.0;
    }
    return most > 0.0 ? value / most : copysign(INFINITY, value);
}

static double share_of_range(const gait_command *command) {
    const double total = fabs(part_of_range(command->vx, RANGE_VX)) + fabs(part_of_range(command->vy, RANGE_VY))
        + fabs(part_of_range(command->yaw_rate, RANGE_YAW_RATE));
    return isnan(total) ? INFINITY : total;
}

static double deepest_crouch(const gait_command *command) {
    const double part = lesser(fabs(part_of_range(command->vx, RANGE_VX)), 1.0);
    return RANGE_CROUCH[0] + part * (RANGE_CROUCH[1] - RANGE_CROUCH[0]);
}

static double room_to_step(const gait_command *command, double crouch) {
    const double slow = RANGE_CROUCH[0], fast = RANGE_CROUCH[1];
    const double ahead = fabs(part_of_range(command->vx, RANGE_VX));
    if (ahead == 0.0 || slow <= fast || crouch <= deepest_crouch(command)) {
        return 1.0;
    }
    return greater((slow - crouch) / ((slow - fast) * ahead), 0.0);
}

static gait_command clamped(const gait_command *asked) {
    gait_command done = {0.0, 0.0, 0.0, 0.0};
    double share, most;
    if (!stops(asked)) {
        share = share_of_range(asked);
        if (!isinf(share)) {
            const double over = share > RANGE_SLACK ? share : 1.0;
            done.vx = asked->vx / over;
            done.vy = asked->vy / over;
            done.yaw_rate = asked->yaw_rate / over;
        }
    }
    most = deepest_crouch(&done);
    if (asked->crouch >= 0.0 && asked->crouch <= most * RANGE_SLACK) {
        done.crouch = lesser(asked->crouch, most);
    } else if (asked->crouch > 0.0 && RANGE_CROUCH[0] != 0.0) {
        done.crouch = most;
    }
    return done;
}

/* gaitchain.balance.attitude.Vertical */

static double limited(double angle) { return lesser(greater(angle, -VERTICAL_REACH), VERTICAL_REACH); }

static gait_planar turned_by(const gait_planar *vector, double angle) {
    const double c = cos(angle), s = sin(angle);
    const gait_planar turned = {c * vector->x - s * vector->y, s * vector->x + c * vector->y};
    return turned;
}

static double length_of(const double *vector) {
    return sqrt(squared(vector[0]) + squared(vector[1]) + squared(vector[2]));
}

static void feel(gait_estimator *own, const gait_sensors *sensors) {
    int i;
    for (i = 0; i < 6; i++) {
        const double now = i < 3 ? sensors->acceleration[i] : sensors->angular_velocity[i - 3];
        const double before = own->smoothed ? own->smooth[i] : now;
        own->smooth[i] = before + GAIT_PERIOD_S / VERTICAL_SMOOTH_S * (now - before);
    }
    own->smoothed = true;
    own->still = fabs(length_of(own->smooth) - GRAVITY) <= VERTICAL_SHAKEN
        && length_of(own->smooth + 3) < VERTICAL_TURNING;
}

static gait_planar off_gravity(const gait_estimator *own, const gait_attitude *attitude) {
    const double x = own->smooth[0], y = own->smooth[1], z = own->smooth[2];
    const gait_planar off = {atan2(y, z) - attitude->roll, atan2(-x, hypot(y, z)) - attitude->pitch};
    return off;
}

static void turn_toward(gait_attitude *attitude, double roll, double pitch, double part) {
    attitude->roll += part * roll;
    attitude->pitch += part * pitch;
}

static double weight_of(const gait_estimator *own, double first_s) { return own->ticks + first_s / GAIT_PERIOD_S; }

static void stand_upright(gait_walker *w, const gait_sensors *sensors) {
    gait_estimator *own = &w->estimator;
    gait_planar off;
    double gain, bias_gain, turn;
    feel(own, sensors);
    if (!own->still) {
        return;
    }
    own->ticks = lesser(own->ticks + 1.0, VERTICAL_MOST_S / GAIT_PERIOD_S);
    gain = 1.0 / weight_of(own, VERTICAL_FIRST_S);
    off = off_gravity(own, &w->walk.attitude);
    bias_gain = 0.25 * squared(lesser(gain, VERTICAL_MOST_RATE * GAIT_PERIOD_S)) / GAIT_PERIOD_S;
    turn = (sensors->angular_velocity[2] - own->bias[2]) / weight_of(own, VERTICAL_FIRST_Z_S);
    own->bias[0] -= bias_gain * off.x;
    own->bias[1] -= bias_gain * off.y;
    own->bias[2] += turn;
    turn_toward(&w->walk.attitude, off.x, off.y, gain);
}

static void settle_upright(gait_walker *w, const gait_sensors *sensors) {
    feel(&w->estimator, sensors);
    if (w->estimator.still) {
        const gait_planar off = off_gravity(&w->estimator, &w->walk.attitude);
        turn_toward(&w->walk.attitude, limited(off.x), limited(off.y), VERTICAL_RATE * GAIT_PERIOD_S);
    }
}

static void note_slope(gait_walker *w) {
    gait_estimator *own = &w->estimator;
    if (own->still) {
        const gait_planar ground = turned_by(&w->walk.measured.foot_tilt, w->walk.attitude.yaw);
        const double part = 1.0 / weight_of(own, VERTICAL_FIRST_S);
        own->slope.x += part * (ground.x - own->slope.x);
        own->slope.y += part * (ground.y - own->slope.y);
    }
}

static void walk_upright(gait_walker *w, double span_s) {
    gait_estimator *own = &w->estimator;
    const gait_planar ground = turned_by(&own->slope, -w->walk.attitude.yaw);
    const double roll = LEGS.foot_tells_roll ? limited(ground.x - w->walk.measured.foot_tilt.x) : 0.0;
    const double pitch = limited(ground.y - w->walk.measured.foot_tilt.y);
    own->bias[0] -= VERTICAL_BIAS_RATE * roll * span_s;
    own->bias[1] -= VERTICAL_BIAS_RATE * pitch * span_s;
    turn_toward(&w->walk.attitude, roll, pitch, VERTICAL_RATE * span_s);
}

static void lean_upright(gait_walker *w, const gait_sensors *sensors) {
    gait_attitude *attitude = &w->walk.attitude;
    const double aside = sensors->acceleration[1] - w->walk.measured.com.vx * attitude->yaw_rate;
    const double off = atan2(aside, sensors->acceleration[2]) - attitude->roll;
    const double roll = lesser(greater(off, -VERTICAL_LEAN_REACH), VERTICAL_LEAN_REACH);
    w->estimator.bias[0] -= 0.25 * squared(VERTICAL_LEAN_RATE) * roll * GAIT_PERIOD_S;
    turn_toward(attitude, roll, 0.0, VERTICAL_LEAN_RATE * GAIT_PERIOD_S);
}

static void leave_stand(gait_estimator *own) {
    own->ticks = lesser(own->ticks, VERTICAL_KEPT_S / GAIT_PERIOD_S);
    own->smoothed = false;
}

/* gaitchain.balance.state_estimation.StateEstimator */

static void weigh_robot(gait_walker *w, const gait_sensors *sensors) {
    gait_walk *walk = &w->walk;
    const double most = walk->gains.offset_reach;
    gait_tuple_bdd off;
    double level[9], part;
    const double ticks = w->estimator.still ? w->estimator.ticks : 0.0;
    if (ticks == 0.0 || walk->gains.learning == 0.0) {
        return;
    }
    w->estimator.unweighed = (w->estimator.unweighed + 1) % WEIGH_EVERY;
    if (w->estimator.unweighed) {
        return;
    }
    rotations_rotation(0.0, walk->attitude.pitch, walk->attitude.roll, level);
    com_estimator_weigh(&LEGS, sensors->joint_position, sensors->joint_velocity, w->targets, level, &off);
    if (off.v0) {
        part = WEIGH_EVERY / (ticks + WEIGH_FIRST_S / GAIT_PERIOD_S);
        walk->com_offset.x += part * (curves_clip(off.v1, -most, most) - walk->com_offset.x);
        walk->com_offset.y += part * (curves_clip(off.v2, -most, most) - walk->com_offset.y);
    }
}

static void estimate(gait_walker *w, const gait_sensors *sensors) {
    const int phase = w->walk.state.phase;
    const gait_planar *error = &w->walk.state.error;
    state_estimation_turn_trunk(&w->walk, sensors->angular_velocity, w->estimator.bias);
    if (!LEGS.foot_tells_roll && phase != STAND && phase != SETTLE) {
        lean_upright(w, sensors);
    }
    if (phase == STAND) {
        stand_upright(w, sensors);
        if (w->targets_known) {
            note_slope(w);
            weigh_robot(w, sensors);
        }
    } else if (phase == SETTLE) {
        settle_upright(w, sensors);
    } else if (phase == SINGLE && w->targets_known) {
        w->estimator.unlooked++;
        if (w->estimator.unlooked >= LOOK_EVERY) {
            w->estimator.unlooked = 0;
            if (hypot(error->x, error->y) < LOOK_NEAR * LEGS.leg) {
                walk_upright(w, LOOK_EVERY * GAIT_PERIOD_S);
            }
        }
    }
}

static void sense(gait_walker *w, const gait_sensors *sensors) {
    estimate(w, sensors);
    if (sensors->has_foot_load) {
        w->walk.load.left = isfinite(sensors->foot_load[0]) ? sensors->foot_load[0] : NAN;
        w->walk.load.right = isfinite(sensors->foot_load[1]) ? sensors->foot_load[1] : NAN;
        w->load_known = true;
    } else if (w->load_known) {
        w->walk.load.left = w->walk.load.right = NAN;
        w->load_known = false;
    }
}

/* gaitchain.balance.walk_controller.WalkController */

static void exchange_frames(gait_state *state, const gait_foot *other) {
    const gait_foot at = *other;
    const gait_state before = *state;
    state_seen_from(&at, &before, state);
}

static bool step_is_made(const gait_walk *walk) { return walk->state.time >= walk->times.step - WALK_SLACK_S; }

static bool wants_stride(const gait_walk *walk) {
    if (walk->state.phase == SHIFT) {
        return walk->state.time >= walk->times.shift - WALK_SLACK_S;
    }
    return walk->state.phase == DOUBLE && step_is_made(walk) && walk->target.stops == 0.0;
}

static void begin_shift(gait_walker *w, bool left_support) {
    gait_state *state = &w->walk.state;
    if (left_support != (state->side > 0.0)) {
        exchange_frames(state, &state->lift_off);
    }
    state->phase = SHIFT;
    state->time = state->worst = state->slip = 0.0;
    leave_stand(&w->estimator);
}

static bool catches(gait_walker *w) {
    gait_state *state = &w->walk.state;
    gait_standing_balance balance;
    if (state->phase != STAND && state->phase != SETTLE && state->phase != SHIFT) {
        return false;
    }
    standing_standing_balance(&LEGS, &w->walk, &balance);
    if (balance.is_capturable) {
        return false;
    }
    if (!balance.swing_steps) {
        exchange_frames(state, &state->lift_off);
    }
    state->phase = SHIFT;
    state->time = w->walk.times.shift;
    leave_stand(&w->estimator);
    return true;
}

static void exchange_feet(gait_walker *w, const double *joints) {
    gait_state *state = &w->walk.state;
    const double left_over = state->time - w->walk.times.step;
    gait_tuple_ddd made;
    support_foot_measured_step(&LEGS, joints, state->side, state->heel, &made);
    w->made[0] = made.v0;
    w->made[1] = made.v1;
    w->made[2] = made.v2;
    w->step_made = true;
    exchange_frames(state, &state->landing);
    state->time = greater(left_over, 0.0);
}

static void begin_step(gait_walk *walk, const gait_step_target *target) {
    gait_state *state = &walk->state;
    const gait_foot landing = {target->length, -target->width, target->turn};
    walk->target = *target;
    state->time = state->phase == SHIFT ? 0.0 : state->time;
    state->phase = SINGLE;
    state->landing = landing;
    state->first_zmp.x = state->first_zmp.y = state->heading = NAN;
    state->rate = 1.0;
    state->worst = state->slip = 0.0;
}

static bool is_pushed(const gait_walk *walk) {
    return fabs(walk->state.error.x) > walk->gains.far_zone.x || fabs(walk->state.error.y) > walk->gains.far_zone.y;
}

static bool comes_to_rest(const gait_walk *walk) {
    const gait_pelvis *pelvis = &walk->state.pelvis;
    if (is_pushed(walk)) {
        return false;
    }
    return hypot(pelvis->vx, pelvis->vy) < WALK_AT_REST || walk->state.time > WALK_LONGEST_SETTLE_S;
}

static void change_phase(gait_walker *w, const double *joints) {
    gait_state *state = &w->walk.state;
    if (state->phase == DOUBLE) {
        if (step_is_made(&w->walk) && w->walk.target.stops > 0.0) {
            exchange_feet(w, joints);
            state->phase = SETTLE;
            state->time = 0.0;
        }
    } else if (state->phase == STAND && is_pushed(&w->walk)) {
        state->phase = SETTLE;
        state->time = 0.0;
    } else if (state->phase == SETTLE && comes_to_rest(&w->walk)) {
        state->phase = STAND;
        state->pelvis.vx = state->pelvis.vy = 0.0;
    }
}

/* gaitchain.walker.step_size.StepSize, gaitchain.chain.recovery.Recovery */

#if RECOVERS
static double cost_of_size(const double *costs, double size) {
    int i = 0;
    if (size >= RECOVERY_SIZES[SIZES - 1]) {
        return costs[SIZES - 1];
    }
    while (RECOVERY_SIZES[i + 1] <= size) {
        i++;
    }
    return costs[i]
        + (costs[i + 1] - costs[i]) / (RECOVERY_SIZES[i + 1] - RECOVERY_SIZES[i]) * (size - RECOVERY_SIZES[i]);
}

static double recovering_size(double unrest, double most) {
    const double *costs = RECOVERY_COST[(int)ceil(unrest) - 1];
    double least = cost_of_size(costs, most);
    const double of_most = least;
    int i, smaller = 0;
    while (smaller < SIZES && RECOVERY_SIZES[smaller] < most) {
        least = lesser(least, cost_of_size(costs, RECOVERY_SIZES[smaller]));
        smaller++;
    }
    if (of_most <= least + RECOVERY_ERROR) {
        return most;
    }
    for (i = smaller - 1; i > 0; i--) {
        if (cost_of_size(costs, RECOVERY_SIZES[i]) <= least + RECOVERY_ERROR) {
            break;
        }
    }
    return RECOVERY_SIZES[i];
}
#endif

static double following_size(gait_walker *w, double off, double most) {
    double level = 0.0;
    int i;
    for (i = 0; i < LEVELS; i++) {
        level += off >= UNREST_ERRORS[i] ? 1.0 : 0.0;
    }
    w->unrest = greater(greater(level, w->unrest - UNREST_DECAY), UNREST_CALM);
#if RECOVERS
    if (w->unrest > UNREST_CALM) {
        return recovering_size(w->unrest, most);
    }
#endif
    return most;
}

/* gaitchain.walker.stride_generator.StrideGenerator */

static void turn_vector(double x, double y, double angle, double *out) {
    const double c = cos(angle), s = sin(angle);
    out[0] = c * x - s * y;
    out[1] = s * x + c * y;
}

static void motion_of(const double *made, double side, double *motion) {
    const double half = 0.5 * side * STANCE;
    double foot[2];
    turn_vector(0.0, -half, made[2], foot);
    turn_vector(made[0] - foot[0], made[1] + half - foot[1], -0.5 * made[2], motion);
    motion[2] = made[2];
}

static void landing_for(const double *motion, double side, double *landing) {
    const double half = 0.5 * side * STANCE;
    double middle[2], foot[2];
    turn_vector(motion[0], motion[1], 0.5 * motion[2], middle);
    turn_vector(0.0, -half, motion[2], foot);
    landing[0] = middle[0] + foot[0];
    landing[1] = -side * (middle[1] - half + foot[1]) - STANCE;
    landing[2] = -side * motion[2];
}

static void asked_motion(const gait_command *command, double side, double *asked) {
    int i;
    asked[0] = command->vx * STEP_S;
    asked[1] = command->vy * STEP_S;
    asked[2] = command->yaw_rate * STEP_S;
    for (i = 1; i < 3; i++) {
        const double share = OUTER_SHARE[i - 1];
        asked[i] *= 2.0 * (-side * asked[i] > 0.0 ? share : 1.0 - share);
    }
}

static void learn_missed(double *missed, const double *owed, double stride) {
    const double teaches = stride / (squared(stride) + STRIDE_TAUGHT * STRIDE_TAUGHT);
    int i;
    for (i = 0; i < 3; i++) {
        const double found = missed[i] + teaches * STRIDE_LEARNED[i] * owed[i];
        missed[i] = lesser(greater(found, -MOST_MISSED[i]), MOST_MISSED[i]);
    }
}

static int nearest_stride(int pose, const double *landing, bool stopping) {
    double least = INFINITY;
    int stride, axis, best = STANDING_POSE;
    for (stride = 0; stride < STRIDES; stride++) {
        double away = 0.0, cost;
        for (axis = 0; axis < 3; axis++) {
            away += squared((STRIDE[stride][axis] - landing[axis]) / STRIDE_TOLERANCE[axis]);
        }
        cost = PATH_COST[pose][stride] + away;
        if (stopping) {
            cost += LATE_STOP * STEPS_TO_STAND[stride];
        } else if (stride == STANDING_POSE) {
            continue;
        }
        if (cost < least) {
            least = cost;
            best = stride;
        }
    }
    return best;
}

/* The step just made lasted so many planned step times; NULL where none was made. */
static void choose_stride(gait_chain *chain, const gait_command *command, const double *made, double lasted) {
    const double side = chain->left_support ? 1.0 : -1.0;
    double asked[3], motion[3], wanted[3], stride;
    int i;
    if (made) {
        motion_of(made, -side, motion);
        for (i = 0; i < 3; i++) {
            chain->owed[i] = chain->owed[i] + lasted * chain->asked[i] - motion[i];
        }
    }
    for (i = 0; i < 3; i++) {
        chain->owed[i] = lesser(greater(chain->owed[i], -MOST_OWED[i]), MOST_OWED[i]);
    }
    asked_motion(command, side, asked);
    if (stops(command)) {
        asked[0] = asked[1] = asked[2] = chain->owed[0] = chain->owed[1] = 0.0;
    }
    stride = asked[0] / LEG;
    learn_missed(chain->missed, chain->owed, stride);
    for (i = 0; i < 3; i++) {
        wanted[i] = asked[i] + (PAID_AT_ONCE * chain->owed[i] + stride * chain->missed[i]);
        chain->asked[i] = asked[i];
    }
    landing_for(wanted, side, chain->landing);
    chain->first = chain->pose;
    chain->target = nearest_stride(chain->pose, chain->landing, stops(command));
}

static void landing_of(const gait_chain *chain, double *landing) {
    int i;
    for (i = 0; i < 3; i++) {
        const double low = CELL_LOW[chain->target][i], high = CELL_HIGH[chain->target][i];
        landing[i] = chain->target == STANDING_POSE ? STRIDE[STANDING_POSE][i]
                                                    : lesser(greater(chain->landing[i], low), high);
    }
}

static double expected_width(const gait_chain *chain, const gait_command *command) {
    const double side = chain->left_support ? 1.0 : -1.0;
    gait_chain end = *chain;
    double landing[3], made[3];
    landing_of(chain, landing);
    made[0] = landing[0];
    made[1] = -side * (STANCE + landing[1]);
    made[2] = -side * landing[2];
    end.layer = 0;
    end.pose = chain->target;
    end.left_support = !chain->left_support;
    choose_stride(&end, command, made, 1.0);
    landing_of(&end, landing);
    return STANCE + landing[1];
}

/* gaitchain.walker.generator.Generator.advance: to the next key pose, which is returned. */
static int advance_chain(gait_chain *chain) {
    static const uint16_t *const choices[3] = {CHOICES_1[0], CHOICES_2[0], CHOICES_3[0]};
    const int pose = choices[chain->layer][chain->target * POSES[chain->layer] + chain->pose];
    chain->pose = pose;
    chain->layer++;
    if (chain->layer == 3) {
        chain->layer = 0;
        chain->left_support = !chain->left_support;
    }
    return pose;
}

/* gaitchain.walker.stride_gait.StrideGait */

static void trim(gait_walker *w, int passing, int landing, gait_step_target *target) {
    const gait_chain *chain = &w->chain;
    double place[3];
    landing_of(chain, place);
    w->usual_error = PAIR_ERROR[chain->first][chain->target];
    w->usual_slip = PAIR_SLIP[chain->first][chain->target];
    target->length = place[0];
    target->width = STANCE + place[1];
    target->turn = place[2];
    target->share = PASSING[passing][0];
    target->share_rate = PASSING[passing][1];
    target->lift = PASSING[passing][2];
    target->landing_rate = LANDING[landing][0];
    target->fall_rate = LANDING[landing][1];
    target->stops = chain->target == STANDING_POSE ? 1.0 : 0.0;
    target->usual_error = w->usual_error + w->own_off * LEG;
}

static double off_plan(const gait_walker *w) {
    const double error = (w->walk.state.worst - w->usual_error) / LEG;
    return greater(error, FOOT_AHEAD * (w->walk.state.slip - w->usual_slip));
}

static void choose_size(gait_walker *w, bool stepped) {
    const double asked = share_of_range(&w->command);
    const double off = off_plan(w), size = following_size(w, off - w->own_off, asked);
    if (stepped) {
        const double made = (double)w->steps - 1.0;
        const double more = greater(UNREST_MORE, UNREST_FIRST * USUAL_OFF / made);
        const double moved = w->own_off + (off > w->own_off ? more : -more / UNREST_LOWERS);
        w->own_off = lesser(greater(moved, 0.0), USUAL_OFF);
    }
    w->carried_out = asked > 0.0 ? greater(size / asked, SMALLEST) : 1.0;
    w->room = greater(room_to_step(&w->command, w->walk.state.crouch), SMALLEST);
}

static void decide(gait_walker *w, const double *made, double lasted, gait_step_target *target) {
    gait_chain *chain = &w->chain;
    const int layer = chain->layer, before = chain->pose;
    gait_command command = w->command;
    double part;
    int pose;
    if (layer == 0) {
        choose_size(w, made != NULL);
    }
    part = w->carried_out * w->room;
    command.vx *= part;
    command.vy *= part;
    command.yaw_rate *= part;
    if (layer == 0) {
        choose_stride(chain, &command, made, lasted);
    }
    pose = advance_chain(chain);
    if (layer == 0) {
        trim(w, pose, CHOICES_2[chain->target][pose], target);
        target->next_width = expected_width(chain, &command);
    } else if (layer == 1) {
        trim(w, before, pose, target);
    }
}

static void measure_slip(gait_walker *w, double *made) {
    const double heading = w->walk.attitude.yaw + w->walk.measured.foot_yaw;
    const double slipped = remainder(heading - w->foot_heading, TAU);
    double turned[2];
    w->foot_heading = heading + made[2];
    turn_vector(made[0], made[1], slipped, turned);
    made[0] = turned[0];
    made[1] = turned[1];
    made[2] = remainder(slipped + made[2], TAU);
}

static void take_step(gait_walker *w, const gait_sensors *sensors) {
    const bool walked = w->walk.state.phase == DOUBLE;
    const long ticks = w->ticks;
    gait_step_target target = w->walk.target;
    double made[3], lasted = 1.0;
    if (walked) {
        exchange_feet(w, sensors->joint_position);
    }
    w->steps++;
    w->ticks = 0;
    if (walked) {
        memcpy(made, w->made, sizeof made);
        lasted = (double)ticks * GAIT_PERIOD_S / w->walk.times.step;
        measure_slip(w, made);
    }
    decide(w, walked ? made : NULL, lasted, &target);
    begin_step(&w->walk, &target);
}

static void start_chain(gait_walker *w) {
    memset(&w->chain, 0, sizeof w->chain);
    w->chain.pose = w->chain.first = w->chain.target = STANDING_POSE;
    w->chain.left_support = w->walk.state.side > 0.0;
    w->foot_heading = w->walk.attitude.yaw;
    w->usual_error = w->usual_slip = 0.0;
}

static bool feet_in_place(const gait_walk *walk) {
    const gait_foot *other = &walk->state.lift_off;
    const double off = greater(fabs(other->x), fabs(other->y + STANCE)) / LEG;
    return off < MISPLACED && fabs(other->yaw) < 2.0 * MISPLACED;
}

static void pass_key_moments(gait_walker *w) {
    const bool over = w->walk.state.time >= w->walk.times.rise;
    if (w->chain.layer == 1 && over) {
        decide(w, NULL, 1.0, &w->walk.target);
    }
    if (w->chain.layer == 2 && w->walk.state.phase == DOUBLE) {
        decide(w, NULL, 1.0, &w->walk.target);
    }
}

/* Move both feet by what they usually slide on the way from a place. */
static void slide(gait_walker *w, const gait_place *before) {
    const gait_place here = gait_where(w);
    const double x = here.x - before->x, y = here.y - before->y;
    double way[2], bend, left;
    int i;
    turn_vector(x, y, -here.yaw, way);
    bend = way[0] > 0.0 ? SLIDE_AHEAD : SLIDE_BACK;
    left = SLIDE_LEFT * way[1] * fabs(way[1]);
    turn_vector(SLIDE_EACH + bend * squared(way[0]), left, here.yaw, way);
    for (i = 0; i < 2; i++) {
        w->feet[i].x += way[0];
        w->feet[i].y += way[1];
    }
}

static void place_foot(gait_walker *w) {
    const gait_place before = gait_where(w);
    const int support = w->walk.state.side > 0.0 ? 0 : 1;
    const double heading = w->walk.attitude.yaw + w->walk.measured.foot_yaw;
    const gait_place *stood = &w->feet[1 - support];
    double way[2];
    turn_vector(w->made[0], w->made[1], heading - w->made[2], way);
    w->feet[support].x = stood->x + way[0];
    w->feet[support].y = stood->y + way[1];
    w->feet[support].yaw = heading;
    slide(w, &before);
    w->step_made = false;
}

static void walk_on(gait_walker *w, const gait_sensors *sensors) {
    gait_state *state = &w->walk.state;
    w->ticks++;
    sense(w, sensors);
    state->crouch_asked = w->command.crouch;
    if (catches(w)) {
        start_chain(w);
    } else if (state->phase == STAND && !(stops(&w->command) && feet_in_place(&w->walk))) {
        begin_shift(w, w->command.vy + STANCE * w->command.yaw_rate <= 0.0);
        start_chain(w);
    }
    if ((state->phase == SINGLE || state->phase == DOUBLE) && !wants_stride(&w->walk)) {
        pass_key_moments(w);
    }
    if (wants_stride(&w->walk)) {
        take_step(w, sensors);
    }
    change_phase(w, sensors->joint_position);
    control_step_control_step(
        &LEGS, &w->walk, sensors->joint_position, sensors->joint_velocity, &w->memory, w->targets);
    w->targets_known = true;
    if (w->step_made) {
        place_foot(w);
    }
}

/* gaitchain.walker.walker.Walker */

static void mend_row(double *values, const double *good, int count, double most) {
    int i;
    for (i = 0; i < count; i++) {
        if (!(fabs(values[i]) < most)) {
            values[i] = good[i];
        }
    }
}

static void mend(const gait_walker *w, gait_sensors *sensors) {
    gait_sensors good = w->good;
    if (!w->has_good) {
        memset(&good, 0, sizeof good);
        memcpy(good.joint_position, STAND_ANGLES, sizeof good.joint_position);
        good.acceleration[2] = GRAVITY;
    }
    if (!isfinite(sensors->time)) {
        sensors->time = good.time + GAIT_PERIOD_S;
    }
    mend_row(sensors->joint_position, good.joint_position, GAIT_JOINTS, MOST_MEASURED[0]);
    mend_row(sensors->joint_velocity, good.joint_velocity, GAIT_JOINTS, MOST_MEASURED[1]);
    mend_row(sensors->angular_velocity, good.angular_velocity, 3, MOST_MEASURED[2]);
    mend_row(sensors->acceleration, good.acceleration, 3, MOST_MEASURED[3]);
}

static bool agree(const double *gyro, const double *other) {
    const double off = greater(fabs(gyro[0] - other[0]), fabs(gyro[1] - other[1]));
    return greater(off, fabs(gyro[2] - other[2])) <= GYRO_JUMP;
}

/* gaitchain.walker.sensor_check.GyroCheck; returns whether the sample is believed. */
static bool check_gyro(gait_walker *w, double *gyro) {
    double before[3];
    memcpy(before, w->gyro, sizeof before);
    memcpy(w->gyro, gyro, sizeof w->gyro);
    if (!w->has_good || agree(gyro, before) || agree(gyro, w->good.angular_velocity)) {
        return true;
    }
    memcpy(gyro, w->good.angular_velocity, sizeof before);
    return false;
}

#if MOUNTED
/* gaitchain.walker.mounting.Mounting */
static void turn_axes(double *vector) {
    const double x = vector[0], y = vector[1], z = vector[2];
    int i;
    for (i = 0; i < 3; i++) {
        vector[i] = MOUNTED_TURN[i][0] * x + MOUNTED_TURN[i][1] * y + MOUNTED_TURN[i][2] * z;
    }
}

static void take_mounting(gait_sensors *sensors) {
    int j;
    for (j = 0; j < GAIT_JOINTS; j++) {
        sensors->joint_position[j] -= MOUNTED_OFFSET[j];
    }
    turn_axes(sensors->angular_velocity);
    turn_axes(sensors->acceleration);
}
#endif

/* gaitchain.walker.target_check.TargetCheck; returns the status. */
static unsigned check_targets(gait_walker *w, double *position) {
    unsigned status = 0;
    int j;
    memcpy(position, w->targets, sizeof w->targets);
    if (!bounds_inside(position, LEGS.lower, LEGS.upper)) {
        status = GAIT_TARGET_CLAMPED;
        for (j = 0; j < GAIT_JOINTS; j++) {
            if (!isfinite(position[j])) {
                status = GAIT_TARGETS_HELD;
            }
        }
        for (j = 0; j < GAIT_JOINTS; j++) {
            position[j] = status == GAIT_TARGETS_HELD ? w->kept[j]
                                                      : curves_clip(position[j], LEGS.lower[j], LEGS.upper[j]);
        }
    }
    memcpy(w->kept, position, sizeof w->kept);
    return status;
}

/* gaitchain.walker.motor_targets.MotorForm */
static void drive_motors(const gait_walker *w, bool held, gait_targets *targets) {
    int j;
    for (j = 0; j < GAIT_JOINTS; j++) {
        const double velocity = held ? 0.0 : w->memory.rates[j];
        const double torque = held ? 0.0 : w->memory.torques[j] + PASSIVE_DAMPING[j] * velocity;
        const double ahead = (torque + gait_damping[j] * velocity) / gait_stiffness[j];
        targets->reference[j] = targets->position[j] - ahead;
        targets->velocity[j] = velocity;
        const double with_load = torque * velocity > 0.0 ? fabs(velocity) : 0.0;
        const double left = greater(1.0 - with_load * TORQUE_LOSS[j], 0.0);
        targets->torque[j] =
            curves_clip(torque, -left * TORQUE_LIMIT[j], left * TORQUE_LIMIT[j]);
    }
}

void gait_step(gait_walker *walker, const gait_sensors *sensors, gait_targets *targets) {
    gait_sensors taken = *sensors;
    unsigned status = 0, checked;
#if MOUNTED
    take_mounting(&taken);
#endif
    if (!isfinite(taken.time)
        || !bounds_sane(
            taken.joint_position, taken.joint_velocity, taken.angular_velocity, taken.acceleration, MOST_MEASURED)) {
        mend(walker, &taken);
        status = GAIT_SENSOR_REPLACED;
    }
    if (!check_gyro(walker, taken.angular_velocity)) {
        status = GAIT_SENSOR_REPLACED;
    }
    walker->good = taken;
    walker->has_good = true;
    walk_on(walker, &taken);
    checked = check_targets(walker, targets->position);
    drive_motors(walker, checked != 0, targets);
#if MOUNTED
    for (int j = 0; j < GAIT_JOINTS; j++) {
        targets->position[j] += MOUNTED_OFFSET[j];
        targets->reference[j] += MOUNTED_OFFSET[j];
    }
#endif
    targets->status = status | checked;
}

void gait_start(gait_walker *walker) {
    memset(walker, 0, sizeof *walker);
    memcpy(walker->kept, STAND_ANGLES, sizeof walker->kept);
    gait_reset(walker);
}

void gait_reset(gait_walker *walker) {
    const gait_command command = walker->command;
    double kept[GAIT_JOINTS];
    memcpy(kept, walker->kept, sizeof kept);
    memset(walker, 0, sizeof *walker);
    memcpy(walker->kept, kept, sizeof kept);
    walker->command = command;
    walker->walk = WALK_AT_START;
    walker->memory = MEMORY_AT_START;
    walker->carried_out = walker->room = 1.0;
    walker->feet[0].y = 0.5 * STANCE;
    walker->feet[1].y = -0.5 * STANCE;
    start_chain(walker);
    walker->chain.left_support = true;
    walker->foot_heading = 0.0;
}

gait_command gait_set_command(gait_walker *walker, const gait_command *command) {
    walker->command = clamped(command);
    return walker->command;
}

bool gait_standing(const gait_walker *walker) { return walker->walk.state.phase == STAND; }

double gait_carried_out(const gait_walker *walker) { return walker->carried_out * walker->room; }

gait_place gait_where(const gait_walker *walker) {
    const gait_place *left = &walker->feet[0], *right = &walker->feet[1];
    const gait_place middle = {
        0.5 * (left->x + right->x), 0.5 * (left->y + right->y), walker->walk.attitude.yaw};
    return middle;
}
