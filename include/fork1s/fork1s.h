/* fork1s from C: models from files, simulations of them, their state and what they meet. C99; the library is
 * libfork1s_c. docs/c.md has a complete program.
 *
 * Status. Functions return FORK1S_OK or an error code and write results through their last pointers, which they
 * leave as they were where they fail; so is the simulation, but for steps made before one that failed. The sentence
 * that says what went wrong is fork1s_last_error(). No exception leaves a function.
 *
 * Threads. A model never changes: any number of threads may use it. A simulation or snapshot is for one thread at a
 * time, each for another one at the same time; a call on a simulation that another thread is in is refused. Errors
 * are those of the calling thread.
 *
 * Memory. What a function hands out as `fork1s_...**` is freed by the function of that name with _free, which takes
 * NULL too. A simulation keeps what it needs of its model, which may be freed before it; so does a snapshot of its
 * simulation. Text that a function hands out belongs to the object asked and lives as long as that. Arrays are the
 * caller's: sizes are asked first, and lengths, in numbers of elements, are checked.
 *
 * Quantities are in m, kg, s, rad, N and N m, in the world frame unless a line says otherwise. Quaternions are w x y
 * z. Text is UTF-8, paths are as the system has them. */
#ifndef FORK1S_FORK1S_H
#define FORK1S_FORK1S_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Version of this interface. It counts up by one with every function or constant that is added, which says since which
 * version it is here; what is here stays as it is within libfork1s_c.so.1. */
#define FORK1S_C_VERSION 4

/* FORK1S_C_VERSION of the library that is loaded: at least that of the header is needed. */
int32_t fork1s_version(void);
/* Version of fork1s that it is part of, such as "0.2.0". */
const char* fork1s_version_text(void);

typedef int32_t fork1s_status;
enum {
  FORK1S_OK = 0,
  FORK1S_ERROR_FILE = 1,            /* a file that cannot be read */
  FORK1S_ERROR_FORMAT = 2,          /* a file whose content cannot be understood */
  FORK1S_ERROR_MODEL = 3,           /* a model that cannot be simulated as given */
  FORK1S_ERROR_UNDERDETERMINED = 4, /* a joint that neither a spring nor an interface holds */
  FORK1S_ERROR_NUMERICS = 5,        /* numbers that are not finite, or a step that could not be solved */
  FORK1S_ERROR_USAGE = 6,           /* NULL, an index, a name, a length or a value that makes no sense here */
  FORK1S_ERROR_MEMORY = 7,          /* out of memory */
  FORK1S_ERROR_INTERNAL = 8         /* an error of the library itself */
};

/* What went wrong in the last call of this thread that failed, with place, cause and remedy; "" before the first. It
 * lives until the next one that fails. */
const char* fork1s_last_error(void);

typedef struct fork1s_model fork1s_model;
typedef struct fork1s_simulation fork1s_simulation;
typedef struct fork1s_snapshot fork1s_snapshot;

/* Models */

/* Reads MJCF or URDF. `options`: NULL, or JSON text with any of
 *   "interface": ["BODY", ...]   bodies that touch the world; in place of what the file says
 *   "switched": ["EQUALITY", ...]  welds and connects that start active and a control switches; likewise
 *   "base": "fixed" | "floating" | "driven"                            likewise
 *   "modes": K | "auto"          fixed-interface modes to keep at most; likewise
 *   "mode_choice": "lowest" | "contribution"                           likewise
 *   "stiffness_scale": X         multiplies every joint spring, its damper by the square root
 *   "pd": [KP, KV]               gains of joints that nothing holds
 *   "joint_pd": {"JOINT": [KP, KV], ...}  of single joints, on top of what holds them; "all": of every other
 *   "keyframe": "NAME"           initial state of the file
 *   "base_pose": [X, Y, Z] or [X, Y, Z, QW, QX, QY, QZ]  where the base starts
 *   "q": {"JOINT": VALUE, ...}   where joints start
 *   "keep_start": true           joints that start outside their limits start there
 *   "hold": true                 set-points of position servos are where their joints start
 *   "ground": true | HEIGHT      adds a level plane
 *   "packages": {"NAME": "FOLDER", ...}   folders of ROS packages
 *   "reader": "PATH"             the program fork1s, which reads the file in a process of its own: a file that
 *                                crashes or stalls its reader is an error then. Without it this process reads.
 *   "read_time": SECONDS         limit of that process, 60 unless given */
fork1s_status fork1s_model_load(const char* path, const char* options, fork1s_model** model);
/* The same of MJCF text without files beside it. `name` stands for the path in messages. */
fork1s_status fork1s_model_load_text(const char* mjcf, const char* name, const char* options,
                                     fork1s_model** model);
void fork1s_model_free(fork1s_model* model);

/* What was left out or changed in reading, and what was chosen where the file says nothing: a sentence each. */
fork1s_status fork1s_model_num_notes(const fork1s_model* model, int32_t* count);
fork1s_status fork1s_model_note(const fork1s_model* model, int32_t index, const char** text);

/* Simulations */

/* `options`: NULL, or JSON text with any of
 *   "dt": SECONDS                time step; the model's unless given
 *   "keyframe": "NAME"           initial state; the model's unless given
 *   "recovery": "exact" | "expanded" | "curved" | "twist"
 *   "detail": "interface" | "parents" | "all"    which bodies may touch
 *   "integrator": "two-stage" | "euler" */
fork1s_status fork1s_simulation_create(const fork1s_model* model, const char* options,
                                       fork1s_simulation** simulation);
void fork1s_simulation_free(fork1s_simulation* simulation);

/* Sentences about doubtful decisions in the reduction and the start. */
fork1s_status fork1s_simulation_num_warnings(const fork1s_simulation* simulation, int32_t* count);
fork1s_status fork1s_simulation_warning(const fork1s_simulation* simulation, int32_t index,
                                        const char** text);

/* What the steps of one call were like. */
typedef struct fork1s_report {
  int32_t steps;           /* made */
  int32_t contacts;        /* contact points in the last step */
  int32_t limits;          /* joint limits that acted in the last step */
  int32_t forces_at_bound; /* servos and motors that gave all they can in the last step */
  int32_t unconverged;     /* steps whose contacts or stages were not solved to tolerance */
  int32_t halved;    /* steps that were taken in parts, for an impact or a stage that did not converge */
  int32_t refreshes; /* linearizations made again */
  int32_t failed_refreshes; /* and those that could not be */
  int32_t contacts_dropped; /* 1: a step met more contacts than the collision detector has room for */
  int32_t finite;           /* 0: a step was undone; the state is that before it */
  double max_penetration;   /* m, of all steps */
  double residual;          /* of the contact solver, relative, the worst */
  double stage_residual;    /* m, by how much another iteration would move something, the worst */
} fork1s_report;

/* How controls go in a step. */
enum {
  FORK1S_HOLD = 0, /* held at the values set, as the output of a controller */
  FORK1S_MOVE =
      1 /* moved linearly over the steps of the call, from where the last step left them to those set, as
                      samples of a path */
};

/* Makes `steps` time steps, 0 or more. `report` may be NULL. FORK1S_ERROR_NUMERICS where one was undone: the state is
 * that before it, and the report is filled. */
fork1s_status fork1s_simulation_step(fork1s_simulation* simulation, int32_t steps, int32_t controls,
                                     fork1s_report* report);

/* s since the simulation was made; the time step in s. */
fork1s_status fork1s_simulation_time(const fork1s_simulation* simulation, double* time);
fork1s_status fork1s_simulation_dt(const fork1s_simulation* simulation, double* dt);
/* J; either may be NULL. Potential energy is that of springs, servos and gravity. */
fork1s_status fork1s_simulation_energy(const fork1s_simulation* simulation, double* kinetic,
                                       double* potential);
/* 64 bits over all that the next step reads; equal where every bit of it is. */
fork1s_status fork1s_simulation_hash(const fork1s_simulation* simulation, uint64_t* hash);

/* Controls: those of all mechanisms, then of every driven base BASE.x .y .z in m and .rx .ry .rz, a rotation vector
 * in rad, from its initial pose. Values hold until changed; those outside the range move to its nearest end. */
fork1s_status fork1s_simulation_num_controls(const fork1s_simulation* simulation, int32_t* count);
fork1s_status fork1s_simulation_control_name(const fork1s_simulation* simulation, int32_t control,
                                             const char** name);
fork1s_status fork1s_simulation_find_control(const fork1s_simulation* simulation, const char* name,
                                             int32_t* control);
/* Infinite where there is no limit. */
fork1s_status fork1s_simulation_control_range(const fork1s_simulation* simulation, int32_t control,
                                              double* lower, double* upper);
fork1s_status fork1s_simulation_controls(const fork1s_simulation* simulation, double* values, size_t length);
fork1s_status fork1s_simulation_set_control(fork1s_simulation* simulation, int32_t control, double value);
/* All of them or, where one is not finite, none. */
fork1s_status fork1s_simulation_set_controls(fork1s_simulation* simulation, const double* values,
                                             size_t length);
/* Of a coordinate of a driven base: its rate at the end of the next step, or of the next call with FORK1S_MOVE, where
 * the path is known. To be set after the value. */
fork1s_status fork1s_simulation_set_control_rate(fork1s_simulation* simulation, int32_t control, double rate);
/* Before the first step: a path of FORK1S_MOVE begins at the controls as they are set, not at their initial values. */
fork1s_status fork1s_simulation_start_from_controls(fork1s_simulation* simulation);

/* Bodies: those of the mechanisms, then free bodies. */
fork1s_status fork1s_simulation_num_bodies(const fork1s_simulation* simulation, int32_t* count);
fork1s_status fork1s_simulation_body_name(const fork1s_simulation* simulation, int32_t body,
                                          const char** name);
fork1s_status fork1s_simulation_find_body(const fork1s_simulation* simulation, const char* name,
                                          int32_t* body);
/* Seven numbers a body: position of its origin, unit quaternion with w of 0 or more. length: 7 times the bodies. */
fork1s_status fork1s_simulation_poses(const fork1s_simulation* simulation, double* poses, size_t length);
fork1s_status fork1s_simulation_pose(const fork1s_simulation* simulation, int32_t body, double pose[7]);
/* Six numbers a body: angular velocity, velocity of its origin. length: 6 times the bodies. */
fork1s_status fork1s_simulation_velocities(const fork1s_simulation* simulation, double* velocities,
                                           size_t length);
/* Force and torque on a body through all steps of the next call of fork1s_simulation_step. The force acts at the point
 * of the body that is at `point` now; NULL: its origin. `force` or `torque` may be NULL: none. Pushes add up. */
fork1s_status fork1s_simulation_push(fork1s_simulation* simulation, int32_t body, const double force[3],
                                     const double torque[3], const double point[3]);
/* A spring with a damper from a point of a body to `target` in the world, as a hand that guides it: the force
 * stiffness (target - x) - damping dx/dt acts at the point x in all steps until fork1s_simulation_release or another call.
 * point: where it is now; NULL: the body's origin. stiffness: N/m, above 0. damping: N s/m; negative: critical for what
 * the point moves. The force is implicit in the step and calm at any stiffness. A mechanism or free body has one: the
 * last. Part of snapshots. Since version 4. */
fork1s_status fork1s_simulation_pull(fork1s_simulation* simulation, int32_t body, const double point[3],
                                     const double target[3], double stiffness, double damping);
/* Ends the pull on a body, if there is one. body -1: all of them. Since version 4. */
fork1s_status fork1s_simulation_release(fork1s_simulation* simulation, int32_t body);

/* Joints of the file that move, in its order and by MuJoCo's conventions. Positions: hinge and slide as the file counts
 * them, rad or m; ball a unit quaternion of the body relative to where its joint hangs; free the position of the body
 * and its quaternion. Velocities: hinge and slide a rate; ball the angular velocity in axes of the body; free the
 * velocity of the body's origin in world axes, then its angular velocity in axes of the body. */
enum { FORK1S_JOINT_FREE = 0, FORK1S_JOINT_BALL = 1, FORK1S_JOINT_SLIDE = 2, FORK1S_JOINT_HINGE = 3 };
typedef struct fork1s_joint {
  const char* name;
  int32_t kind;                          /* FORK1S_JOINT_... */
  int32_t first_position, num_positions; /* among those of all joints */
  int32_t first_velocity, num_velocities;
} fork1s_joint;
fork1s_status fork1s_simulation_num_joints(const fork1s_simulation* simulation, int32_t* count);
fork1s_status fork1s_simulation_joint(const fork1s_simulation* simulation, int32_t index,
                                      fork1s_joint* joint);
fork1s_status fork1s_simulation_find_joint(const fork1s_simulation* simulation, const char* name,
                                           int32_t* index);
fork1s_status fork1s_simulation_num_joint_positions(const fork1s_simulation* simulation, int32_t* count);
fork1s_status fork1s_simulation_num_joint_velocities(const fork1s_simulation* simulation, int32_t* count);
fork1s_status fork1s_simulation_joint_positions(const fork1s_simulation* simulation, double* positions,
                                                size_t length);
fork1s_status fork1s_simulation_joint_velocities(const fork1s_simulation* simulation, double* velocities,
                                                 size_t length);
/* Goes on from another state; NULL with length 0: these stay. Loops that positions leave open are closed by the smallest
 * change. Controls stay; those of a driven base count from its new pose. Contacts are found again and the time goes on.
 * Takes milliseconds. */
fork1s_status fork1s_simulation_set_joint_state(fork1s_simulation* simulation, const double* positions,
                                                size_t num_positions, const double* velocities,
                                                size_t num_velocities);
/* Largest difference, rad or m, between a joint coordinate as it was set last and what it became when loops were
 * closed; 0 where none was set. */
fork1s_status fork1s_simulation_state_change(const fork1s_simulation* simulation, double* change);

/* Sensors of the file: their values at the end of the last step, NaN where there are none. */
typedef struct fork1s_sensor {
  const char* name;
  const char* missing; /* why it has no values here; "" where it has */
  int32_t first_value, num_values;
} fork1s_sensor;
fork1s_status fork1s_simulation_num_sensors(const fork1s_simulation* simulation, int32_t* count);
fork1s_status fork1s_simulation_sensor(const fork1s_simulation* simulation, int32_t index,
                                       fork1s_sensor* sensor);
fork1s_status fork1s_simulation_find_sensor(const fork1s_simulation* simulation, const char* name,
                                            int32_t* index);
fork1s_status fork1s_simulation_num_sensor_values(const fork1s_simulation* simulation, int32_t* count);
fork1s_status fork1s_simulation_sensor_values(const fork1s_simulation* simulation, double* values,
                                              size_t length);

/* A contact point that bears force, of the last step. */
typedef struct fork1s_contact {
  int32_t body_a, body_b; /* -1: the still world */
  double point[3];
  double normal[3]; /* from a to b */
  double force[3];  /* on b, mean of the step */
  double torque[3]; /* on b about the point, of torsional and rolling friction */
  double gap;       /* m, negative in penetration, as the step found it */
  double friction;  /* coefficient */
} fork1s_contact;
fork1s_status fork1s_simulation_num_contacts(const fork1s_simulation* simulation, int32_t* count);
/* Into the first `*count` of an array of `length`, which is refused where it is shorter than that. */
fork1s_status fork1s_simulation_contacts(const fork1s_simulation* simulation, fork1s_contact* contacts,
                                         size_t length, int32_t* count);
/* Friction use of each contact, in the order of fork1s_simulation_contacts: |f_t| / (mu f_n) of its force, 1 where it
 * slides, 0 without friction. length: the number of contacts. Since version 2. */
fork1s_status fork1s_simulation_friction_uses(const fork1s_simulation* simulation, double* uses,
                                              size_t length);

/* Where a ray meets a body. */
typedef struct fork1s_ray_hit {
  int32_t body;    /* -1: the still world */
  double distance; /* m, from the origin of the ray */
  double point[3];
  double normal[3]; /* unit, of the surface, towards where the ray came from */
} fork1s_ray_hit;
/* The first body along `direction`, of any length above 0, from `origin`, no farther than `reach` in m, which may be
 * INFINITY. `found`: 1, or 0 where there is none, which leaves `hit` as it was. All bodies are seen, by the shapes that
 * collide, or by all of a body that has none of these; meshes are their convex hulls. An origin within a shape may see
 * that shape from inside or not at all. Since version 3. */
fork1s_status fork1s_simulation_ray(const fork1s_simulation* simulation, const double origin[3],
                                    const double direction[3], double reach, int32_t* found,
                                    fork1s_ray_hit* hit);

/* A moment to come back to: state, controls, pushes of the next call and time. Steps from there give the same bits. */
fork1s_status fork1s_simulation_save(const fork1s_simulation* simulation, fork1s_snapshot** snapshot);
/* To a moment of this simulation or of another one of the same fork1s_model and dt. */
fork1s_status fork1s_simulation_restore(fork1s_simulation* simulation, const fork1s_snapshot* snapshot);
void fork1s_snapshot_free(fork1s_snapshot* snapshot);
/* To the moment at which it was made. */
fork1s_status fork1s_simulation_reset(fork1s_simulation* simulation);

#ifdef __cplusplus
}
#endif

#endif
