/* Every function of the C interface from a program in C: what it gives, and what misuse gives. */
#include <fork1s/fork1s.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failures = 0;

static void expect(int holds, const char* what, int line) {
  if (holds) return;
  ++failures;
  fprintf(stderr, "calls.c:%d: %s does not hold; last error: %s\n", line, what, fork1s_last_error());
}
#define EXPECT(condition) expect((condition) ? 1 : 0, #condition, __LINE__)

/* A call that is refused as misuse, with a sentence that has `text`. */
static void refused(fork1s_status status, const char* text, int line) {
  if (status == FORK1S_ERROR_USAGE && strstr(fork1s_last_error(), text)) return;
  ++failures;
  fprintf(stderr, "calls.c:%d: status %d, wanted a sentence with \"%s\", got: %s\n", line, (int)status, text,
          fork1s_last_error());
}
#define REFUSED(call, text) refused((call), (text), __LINE__)

static fork1s_model* load(const char* folder, const char* file) {
  char path[4096];
  fork1s_model* model = NULL;
  snprintf(path, sizeof path, "%s/%s", folder, file);
  if (fork1s_model_load(path, NULL, &model) != FORK1S_OK) {
    fprintf(stderr, "%s\n", fork1s_last_error());
    exit(1);
  }
  return model;
}

static const char* kPendulum =
    "<mujoco><worldbody><body name='bob' pos='0 0 1'><joint name='hinge' axis='0 1 0' stiffness='2'/>"
    "<geom type='sphere' size='0.1' pos='0 0 -0.5' mass='1'/></body></worldbody>"
    "<actuator><position name='servo' joint='hinge' kp='3'/></actuator></mujoco>";

static void test_models(const char* folder) {
  fork1s_model* model = NULL;
  fork1s_simulation* simulation = NULL;
  int32_t count = -1;
  const char* text = NULL;
  EXPECT(fork1s_version() == FORK1S_C_VERSION);
  EXPECT(strlen(fork1s_version_text()) > 0);
  EXPECT(strcmp(fork1s_last_error(), "") == 0);
  fork1s_model_free(NULL);
  fork1s_simulation_free(NULL);

  REFUSED(fork1s_model_load(NULL, NULL, &model), "fork1s_model_load: path is NULL");
  REFUSED(fork1s_model_load("x.xml", NULL, NULL), "model is NULL");
  EXPECT(fork1s_model_load("no/such.xml", NULL, &model) == FORK1S_ERROR_FILE);
  EXPECT(strstr(fork1s_last_error(), "no/such.xml") != NULL);
  EXPECT(fork1s_model_load_text("<mujoco><worldbody>", "text", NULL, &model) == FORK1S_ERROR_FORMAT);
  REFUSED(fork1s_model_load_text(NULL, "text", NULL, &model), "mjcf is NULL");
  REFUSED(fork1s_model_load_text(kPendulum, NULL, NULL, &model), "name is NULL");
  EXPECT(model == NULL);

  REFUSED(fork1s_model_load_text(kPendulum, "t", "{", &model), "are no JSON text");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "[]", &model), "must be one JSON object");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"bse\": \"fixed\"}", &model),
          "option 'bse': there is no such option; near names are 'base'");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"base\": \"loose\"}", &model),
          "option 'base': 'loose' is none of: fixed, floating, driven");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"base\": 1}", &model), "must be text, not 1");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"dt\": 1}", &model),
          "option 'dt': is an option of fork1s_simulation_create");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"pd\": [1, 2, 3]}", &model), "two gains [KP, KV]");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"pd\": [1, -2]}", &model), "gains must be 0 or more");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"modes\": 1.5}", &model), "a whole number");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"modes\": -1}", &model), "a whole number");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"q\": {\"hinge\": \"far\"}}", &model),
          "option 'q.hinge': must be a number");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"base_pose\": [1, 2]}", &model), "a position [X, Y, Z]");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"base_pose\": [0, 0, 0, 0, 0, 0, 0]}", &model),
          "a quaternion of length 0");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"keep_start\": 1}", &model), "true or false");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"ground\": \"low\"}", &model), "true, false or a height");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"interface\": \"bob\"}", &model), "a list of names");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"ground\": 1e999}", &model), "are no JSON text");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"q\": {\"a\": 1, \"a\": 2}}", &model), "is given twice");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"interface\": [\"bib\"]}", &model), "bib");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"keyframe\": \"home\"}", &model), "home");
  REFUSED(fork1s_model_load_text(kPendulum, "t", "{\"reader\": \"fork1s\"}", &model),
          "text is read in this process");
  REFUSED(fork1s_model_load("x.xml", "{\"read_time\": 0}", &model), "option 'read_time': must be above 0 s");
  EXPECT(fork1s_model_load("x.xml", "{\"reader\": \"/no/such/program\"}", &model) == FORK1S_ERROR_MODEL);
  EXPECT(strstr(fork1s_last_error(), "/no/such/program") != NULL);
  EXPECT(model == NULL);

  EXPECT(fork1s_model_load_text("<mujoco><worldbody><body name='b'><joint stiffness='1'/><geom size='0.1' "
                                "mass='1'/></body></worldbody><sensor><user dim='1'/></sensor></mujoco>",
                                "text", "{\"interface\": [\"b\"]}", &model) == FORK1S_OK);
  EXPECT(fork1s_model_num_notes(model, &count) == FORK1S_OK && count > 0);
  EXPECT(fork1s_model_note(model, 0, &text) == FORK1S_OK && strlen(text) > 0);
  REFUSED(fork1s_model_note(model, count, &text), "indices count from 0");
  REFUSED(fork1s_model_note(model, -1, &text), "note -1 of");
  REFUSED(fork1s_model_note(NULL, 0, &text), "model is NULL");
  REFUSED(fork1s_model_note(model, 0, NULL), "text is NULL");
  REFUSED(fork1s_model_num_notes(NULL, &count), "model is NULL");
  REFUSED(fork1s_model_num_notes(model, NULL), "count is NULL");

  REFUSED(fork1s_simulation_create(NULL, NULL, &simulation), "model is NULL");
  REFUSED(fork1s_simulation_create(model, NULL, NULL), "simulation is NULL");
  REFUSED(fork1s_simulation_create(model, "{\"dt\": 0}", &simulation), "option 'dt': must be above 0 s");
  REFUSED(fork1s_simulation_create(model, "{\"integrator\": \"theta\"}", &simulation),
          "no longer an integrator");
  REFUSED(fork1s_simulation_create(model, "{\"recovery\": \"none\"}", &simulation),
          "is none of: exact, expanded, curved, twist");
  REFUSED(fork1s_simulation_create(model, "{\"detail\": \"object\"}", &simulation),
          "is none of: interface, parents, all");
  REFUSED(fork1s_simulation_create(model, "{\"keyframe\": \"home\"}", &simulation),
          "there is no keyframe 'home'");
  REFUSED(fork1s_simulation_create(model, "{\"pd\": [1, 1]}", &simulation),
          "is an option of fork1s_model_load");
  EXPECT(simulation == NULL);
  fork1s_model_free(model);
  (void)folder;
}

static void test_controls_and_bodies(const char* folder) {
  fork1s_model* model = load(folder, "fourbar_gripper.xml");
  fork1s_simulation* s = NULL;
  int32_t count = 0, at = -1;
  const char* name = NULL;
  double values[2] = {0.1, 0.2}, number = 0, other = 0, pose[7], force[3] = {1, 0, 0};
  double* numbers;
  size_t bodies;
  uint64_t before = 0, after = 1;
  fork1s_report report;
  EXPECT(fork1s_simulation_create(model, NULL, &s) == FORK1S_OK);
  fork1s_model_free(model);

  EXPECT(fork1s_simulation_num_controls(s, &count) == FORK1S_OK && count == 2);
  EXPECT(fork1s_simulation_control_name(s, 1, &name) == FORK1S_OK && strcmp(name, "right_grip") == 0);
  EXPECT(fork1s_simulation_find_control(s, "right_grip", &at) == FORK1S_OK && at == 1);
  EXPECT(fork1s_simulation_control_range(s, 0, &number, &other) == FORK1S_OK && number == -0.5 &&
         other == 0.5);
  EXPECT(fork1s_simulation_set_control(s, 0, 7) == FORK1S_OK);
  EXPECT(fork1s_simulation_controls(s, values, 2) == FORK1S_OK && values[0] == 0.5 && values[1] == 0);
  EXPECT(fork1s_simulation_hash(s, &before) == FORK1S_OK);
  REFUSED(fork1s_simulation_find_control(s, "thumb", &at),
          "there is no control 'thumb'; there are: left_grip");
  REFUSED(fork1s_simulation_find_control(s, NULL, &at), "name is NULL");
  REFUSED(fork1s_simulation_control_name(s, 2, &name), "control 2 of 2");
  REFUSED(fork1s_simulation_control_range(s, -1, &number, &other), "control -1 of 2");
  REFUSED(fork1s_simulation_control_range(s, 0, NULL, &other), "lower is NULL");
  REFUSED(fork1s_simulation_set_control(s, 2, 0), "control 2 of 2");
  REFUSED(fork1s_simulation_set_control(s, 0, NAN), "finite");
  REFUSED(fork1s_simulation_set_control(s, 0, INFINITY), "finite");
  values[1] = NAN;
  REFUSED(fork1s_simulation_set_controls(s, values, 2), "finite");
  REFUSED(fork1s_simulation_set_controls(s, values, 1), "values has length 1 and needs 2");
  REFUSED(fork1s_simulation_set_controls(s, NULL, 2), "values is NULL");
  REFUSED(fork1s_simulation_controls(s, values, 3), "values has length 3 and needs 2");
  REFUSED(fork1s_simulation_set_control_rate(s, 0, 1), "is no coordinate of a driven base");
  EXPECT(fork1s_simulation_hash(s, &after) == FORK1S_OK && before == after);

  EXPECT(fork1s_simulation_num_bodies(s, &count) == FORK1S_OK && count > 0);
  bodies = (size_t)count;
  numbers = malloc(7 * bodies * sizeof *numbers);
  if (!numbers) exit(1);
  EXPECT(fork1s_simulation_find_body(s, "cube", &at) == FORK1S_OK);
  EXPECT(fork1s_simulation_body_name(s, at, &name) == FORK1S_OK && strcmp(name, "cube") == 0);
  EXPECT(fork1s_simulation_poses(s, numbers, 7 * bodies) == FORK1S_OK);
  EXPECT(fork1s_simulation_pose(s, at, pose) == FORK1S_OK);
  EXPECT(memcmp(pose, numbers + 7 * at, sizeof pose) == 0);
  EXPECT(fork1s_simulation_velocities(s, numbers, 6 * bodies) == FORK1S_OK);
  REFUSED(fork1s_simulation_poses(s, numbers, 6 * bodies), "poses has length");
  REFUSED(fork1s_simulation_poses(s, NULL, 7 * bodies), "poses is NULL");
  REFUSED(fork1s_simulation_velocities(s, numbers, 7 * bodies), "velocities has length");
  REFUSED(fork1s_simulation_pose(s, count, pose), "indices count from 0");
  REFUSED(fork1s_simulation_pose(s, 0, NULL), "pose is NULL");
  REFUSED(fork1s_simulation_body_name(s, -2, &name), "body -2 of");
  REFUSED(fork1s_simulation_find_body(s, "nobody", &at), "there is no body 'nobody'");
  REFUSED(fork1s_simulation_push(s, count, force, NULL, NULL), "body");
  force[2] = NAN;
  REFUSED(fork1s_simulation_push(s, 0, force, NULL, NULL), "force must be finite, and entry 2 is");

  REFUSED(fork1s_simulation_step(s, -1, FORK1S_HOLD, &report), "steps is -1");
  REFUSED(fork1s_simulation_step(s, 1, 2, &report), "give FORK1S_HOLD or FORK1S_MOVE");
  REFUSED(fork1s_simulation_step(NULL, 1, FORK1S_HOLD, &report), "simulation is NULL");
  EXPECT(fork1s_simulation_start_from_controls(s) == FORK1S_OK);
  EXPECT(fork1s_simulation_step(s, 0, FORK1S_MOVE, &report) == FORK1S_OK && report.steps == 0);
  EXPECT(fork1s_simulation_step(s, 3, FORK1S_MOVE, &report) == FORK1S_OK && report.steps == 3);
  REFUSED(fork1s_simulation_start_from_controls(s), "call it before the first");
  EXPECT(fork1s_simulation_dt(s, &other) == FORK1S_OK);
  EXPECT(fork1s_simulation_time(s, &number) == FORK1S_OK && number == 3 * other);
  EXPECT(fork1s_simulation_energy(s, &number, NULL) == FORK1S_OK && number > 0);
  EXPECT(fork1s_simulation_num_warnings(s, &count) == FORK1S_OK && count >= 0);
  REFUSED(fork1s_simulation_warning(s, count, &name), "warning");
  REFUSED(fork1s_simulation_hash(s, NULL), "hash is NULL");
  REFUSED(fork1s_simulation_hash(NULL, &before), "simulation is NULL");
  fork1s_simulation_free(s);
  free(numbers);
}

static void test_state(const char* folder) {
  fork1s_model* model = load(folder, "two_link_arm.xml");
  fork1s_simulation* s = NULL;
  fork1s_snapshot* snapshot = NULL;
  fork1s_joint joint;
  fork1s_sensor sensor;
  fork1s_contact contact;
  int32_t count = -1, at = -1;
  double two[2] = {0.1, -0.2}, number = -1;
  EXPECT(fork1s_simulation_create(model, NULL, &s) == FORK1S_OK);
  fork1s_model_free(model);
  EXPECT(fork1s_simulation_num_joints(s, &count) == FORK1S_OK && count == 2);
  EXPECT(fork1s_simulation_joint(s, 1, &joint) == FORK1S_OK && strcmp(joint.name, "elbow") == 0);
  EXPECT(joint.kind == FORK1S_JOINT_HINGE && joint.first_position == 1 && joint.num_velocities == 1);
  EXPECT(fork1s_simulation_find_joint(s, "elbow", &at) == FORK1S_OK && at == 1);
  EXPECT(fork1s_simulation_num_joint_positions(s, &count) == FORK1S_OK && count == 2);
  EXPECT(fork1s_simulation_num_joint_velocities(s, &count) == FORK1S_OK && count == 2);
  EXPECT(fork1s_simulation_set_joint_state(s, two, 2, NULL, 0) == FORK1S_OK);
  two[0] = two[1] = 7;
  EXPECT(fork1s_simulation_joint_positions(s, two, 2) == FORK1S_OK);
  EXPECT(fabs(two[0] - 0.1) < 1e-15 && fabs(two[1] + 0.2) < 1e-15);
  EXPECT(fork1s_simulation_joint_velocities(s, two, 2) == FORK1S_OK && two[0] == 0 && two[1] == 0);
  EXPECT(fork1s_simulation_state_change(s, &number) == FORK1S_OK && number < 1e-15);
  REFUSED(fork1s_simulation_joint(s, 2, &joint), "joint 2 of 2");
  REFUSED(fork1s_simulation_joint(s, 0, NULL), "joint is NULL");
  REFUSED(fork1s_simulation_find_joint(s, "knee", &at), "there is no joint that moves 'knee'");
  REFUSED(fork1s_simulation_joint_positions(s, two, 1), "positions has length 1 and needs 2");
  REFUSED(fork1s_simulation_joint_velocities(s, NULL, 2), "velocities is NULL");
  REFUSED(fork1s_simulation_set_joint_state(s, two, 1, NULL, 0), "positions has length 1 and needs 2");
  REFUSED(fork1s_simulation_set_joint_state(s, NULL, 2, NULL, 0), "positions is NULL");
  two[1] = NAN;
  REFUSED(fork1s_simulation_set_joint_state(s, NULL, 0, two, 2),
          "velocities must be finite, and entry 1 is nan");

  EXPECT(fork1s_simulation_num_sensors(s, &count) == FORK1S_OK && count == 0);
  EXPECT(fork1s_simulation_num_sensor_values(s, &count) == FORK1S_OK && count == 0);
  EXPECT(fork1s_simulation_sensor_values(s, NULL, 0) == FORK1S_OK);
  REFUSED(fork1s_simulation_sensor_values(s, two, 2), "values has length 2 and needs 0");
  REFUSED(fork1s_simulation_sensor(s, 0, &sensor), "sensor 0 of 0");
  REFUSED(fork1s_simulation_find_sensor(s, "gyro", &at), "there is no sensor 'gyro'");

  EXPECT(fork1s_simulation_num_contacts(s, &count) == FORK1S_OK && count == 0);
  EXPECT(fork1s_simulation_contacts(s, NULL, 0, &count) == FORK1S_OK && count == 0);
  EXPECT(fork1s_simulation_contacts(s, &contact, 1, &count) == FORK1S_OK && count == 0);
  REFUSED(fork1s_simulation_contacts(s, &contact, 1, NULL), "count is NULL");

  EXPECT(fork1s_simulation_friction_uses(s, NULL, 0) == FORK1S_OK);
  REFUSED(fork1s_simulation_friction_uses(s, two, 2), "uses has length 2 and needs 0");
  REFUSED(fork1s_simulation_friction_uses(NULL, two, 2), "simulation is NULL");

  fork1s_snapshot_free(NULL);
  REFUSED(fork1s_simulation_save(s, NULL), "snapshot is NULL");
  REFUSED(fork1s_simulation_restore(s, NULL), "snapshot is NULL");
  EXPECT(fork1s_simulation_save(s, &snapshot) == FORK1S_OK);
  EXPECT(fork1s_simulation_step(s, 10, FORK1S_HOLD, NULL) == FORK1S_OK);
  EXPECT(fork1s_simulation_restore(s, snapshot) == FORK1S_OK);
  EXPECT(fork1s_simulation_joint_positions(s, two, 2) == FORK1S_OK && fabs(two[0] - 0.1) < 1e-15);
  EXPECT(fork1s_simulation_reset(s) == FORK1S_OK);
  EXPECT(fork1s_simulation_joint_positions(s, two, 2) == FORK1S_OK && two[0] == 0);
  REFUSED(fork1s_simulation_reset(NULL), "simulation is NULL");
  fork1s_simulation_free(s);
  fork1s_snapshot_free(snapshot);
}

/* A block on a plane, which a horizontal force pushes. */
static void test_friction(void) {
  const double weight = 9.81, friction = 0.5;
  fork1s_model* model = NULL;
  fork1s_simulation* s = NULL;
  fork1s_contact contacts[16];
  double uses[16];
  int32_t block = -1, count = 0;
  EXPECT(
      fork1s_model_load_text(
          "<mujoco><worldbody><geom type='plane' size='1 1 1' friction='0.5'/><body name='block' pos='0 0 0.05'>"
          "<freejoint/><geom type='box' size='0.1 0.1 0.05' mass='1' friction='0.5'/></body></worldbody></mujoco>",
          "block", NULL, &model) == FORK1S_OK);
  EXPECT(fork1s_simulation_create(model, NULL, &s) == FORK1S_OK);
  fork1s_model_free(model);
  EXPECT(fork1s_simulation_step(s, 60, FORK1S_HOLD, NULL) == FORK1S_OK);
  EXPECT(fork1s_simulation_find_body(s, "block", &block) == FORK1S_OK);
  /* It stays, then it slides. */
  for (int slides = 0; slides < 2; ++slides) {
    const double push = slides ? 2 * friction * weight : 0.4 * friction * weight;
    const double force[3] = {push, 0, 0};
    double sum = 0;
    EXPECT(fork1s_simulation_push(s, block, force, NULL, NULL) == FORK1S_OK);
    EXPECT(fork1s_simulation_step(s, 30, FORK1S_HOLD, NULL) == FORK1S_OK);
    EXPECT(fork1s_simulation_contacts(s, contacts, 16, &count) == FORK1S_OK && count > 0);
    EXPECT(fork1s_simulation_friction_uses(s, uses, (size_t)count) == FORK1S_OK);
    REFUSED(fork1s_simulation_friction_uses(s, uses, (size_t)count - 1), "uses has length");
    REFUSED(fork1s_simulation_friction_uses(s, NULL, (size_t)count), "uses is NULL");
    for (int32_t i = 0; i < count; ++i) {
      const double normal = fabs(contacts[i].force[2]);
      const double tangential = uses[i] * friction * normal, *f = contacts[i].force;
      EXPECT(fabs(tangential * tangential - f[0] * f[0] - f[1] * f[1]) < 1e-9);
      sum += tangential;
    }
    /* To the tolerance of the contact solver. */
    EXPECT(fabs(sum - (slides ? friction * weight : push)) < 1e-4 * weight);
  }
  fork1s_simulation_free(s);
}

/* Rays onto a ball on a hinge, which moves, and a plane below it. */
static void test_rays(void) {
  const double origin[3] = {0, 0, 3}, down[3] = {0, 0, -2}, up[3] = {0, 0, 1}, zero[3] = {0, 0, 0},
               huge[3] = {1e300, 1e300, 0}, broken[3] = {0, NAN, 0}, turned = 1.5;
  fork1s_model* model = NULL;
  fork1s_simulation* s = NULL;
  fork1s_ray_hit hit = {7, 7, {7, 7, 7}, {7, 7, 7}};
  int32_t bob = -1, found = -1;
  EXPECT(
      fork1s_model_load_text(
          "<mujoco><worldbody><geom type='plane' size='1 1 1' pos='0 0 -2'/><body name='bob' pos='0 0 1'>"
          "<joint name='hinge' axis='0 1 0' stiffness='2'/><geom type='sphere' size='0.1' pos='0 0 -0.5' mass='1'/>"
          "</body></worldbody></mujoco>",
          "pendulum", NULL, &model) == FORK1S_OK);
  EXPECT(fork1s_simulation_create(model, NULL, &s) == FORK1S_OK);
  fork1s_model_free(model);
  EXPECT(fork1s_simulation_find_body(s, "bob", &bob) == FORK1S_OK);
  EXPECT(fork1s_simulation_ray(s, origin, up, INFINITY, &found, &hit) == FORK1S_OK && found == 0);
  EXPECT(fork1s_simulation_ray(s, origin, down, 2.3, &found, &hit) == FORK1S_OK && found == 0);
  EXPECT(hit.body == 7 && hit.distance == 7 && hit.normal[2] == 7);
  EXPECT(fork1s_simulation_ray(s, origin, down, 2.5, &found, &hit) == FORK1S_OK && found == 1);
  EXPECT(hit.body == bob && fabs(hit.distance - 2.4) < 1e-12);
  EXPECT(fabs(hit.point[2] - 0.6) < 1e-12 && fabs(hit.point[0]) < 1e-12 && fabs(hit.normal[2] - 1) < 1e-12);
  /* Out of the way. */
  EXPECT(fork1s_simulation_set_joint_state(s, &turned, 1, NULL, 0) == FORK1S_OK);
  EXPECT(fork1s_simulation_ray(s, origin, down, INFINITY, &found, &hit) == FORK1S_OK && found == 1);
  EXPECT(hit.body == -1 && fabs(hit.distance - 5) < 1e-12 && fabs(hit.point[2] + 2) < 1e-12);
  EXPECT(fork1s_simulation_reset(s) == FORK1S_OK);
  EXPECT(fork1s_simulation_ray(s, origin, down, INFINITY, &found, &hit) == FORK1S_OK && hit.body == bob);

  hit.body = found = 7;
  REFUSED(fork1s_simulation_ray(NULL, origin, down, 1, &found, &hit), "simulation is NULL");
  REFUSED(fork1s_simulation_ray(s, NULL, down, 1, &found, &hit), "origin is NULL");
  REFUSED(fork1s_simulation_ray(s, origin, NULL, 1, &found, &hit), "direction is NULL");
  REFUSED(fork1s_simulation_ray(s, origin, down, 1, NULL, &hit), "found is NULL");
  REFUSED(fork1s_simulation_ray(s, origin, down, 1, &found, NULL), "hit is NULL");
  REFUSED(fork1s_simulation_ray(s, broken, down, 1, &found, &hit),
          "origin must be finite, and entry 1 is nan");
  REFUSED(fork1s_simulation_ray(s, origin, zero, 1, &found, &hit), "direction must not be zero");
  REFUSED(fork1s_simulation_ray(s, origin, huge, 1, &found, &hit), "nor so long");
  REFUSED(fork1s_simulation_ray(s, origin, down, -1, &found, &hit), "reach must be 0 m or more");
  REFUSED(fork1s_simulation_ray(s, origin, down, NAN, &found, &hit), "reach must be 0 m or more");
  EXPECT(hit.body == 7 && found == 7);
  fork1s_simulation_free(s);
}

/* A ball that hangs by a spring. */
static void test_pulls(void) {
  const double stiffness = 50, weight = 2 * 9.81, target[3] = {0.1, 0, 1}, moved[3] = {0, 0, 2};
  const double broken[3] = {0, NAN, 0};
  fork1s_model* model = NULL;
  fork1s_simulation* s = NULL;
  fork1s_snapshot* hanging = NULL;
  double pose[7], before[6], after[6];
  EXPECT(fork1s_model_load_text("<mujoco><worldbody><body name='ball' pos='0 0 1'><freejoint/>"
                                "<geom size='0.1' mass='2'/></body></worldbody></mujoco>",
                                "ball", NULL, &model) == FORK1S_OK);
  EXPECT(fork1s_simulation_create(model, NULL, &s) == FORK1S_OK);
  fork1s_model_free(model);
  EXPECT(fork1s_simulation_pull(s, 0, NULL, target, stiffness, -1) == FORK1S_OK);
  EXPECT(fork1s_simulation_step(s, 600, FORK1S_HOLD, NULL) == FORK1S_OK);
  EXPECT(fork1s_simulation_pose(s, 0, pose) == FORK1S_OK);
  EXPECT(fabs(pose[0] - 0.1) < 1e-9 && fabs(pose[2] - (1 - weight / stiffness)) < 1e-9);
  EXPECT(fork1s_simulation_save(s, &hanging) == FORK1S_OK);
  EXPECT(fork1s_simulation_pull(s, 0, pose, moved, stiffness, 20) == FORK1S_OK);
  EXPECT(fork1s_simulation_step(s, 600, FORK1S_HOLD, NULL) == FORK1S_OK);
  EXPECT(fork1s_simulation_pose(s, 0, pose) == FORK1S_OK);
  EXPECT(fabs(pose[0]) < 1e-9 && fabs(pose[2] - (2 - weight / stiffness)) < 1e-9);
  EXPECT(fork1s_simulation_restore(s, hanging) == FORK1S_OK);
  fork1s_snapshot_free(hanging);
  EXPECT(fork1s_simulation_set_joint_state(s, NULL, 0, NULL, 0) == FORK1S_OK);
  EXPECT(fork1s_simulation_step(s, 60, FORK1S_HOLD, NULL) == FORK1S_OK);
  EXPECT(fork1s_simulation_pose(s, 0, pose) == FORK1S_OK);
  EXPECT(fabs(pose[2] - (1 - weight / stiffness)) < 1e-9);
  EXPECT(fork1s_simulation_velocities(s, before, 6) == FORK1S_OK);
  EXPECT(fork1s_simulation_release(s, 0) == FORK1S_OK && fork1s_simulation_release(s, -1) == FORK1S_OK);
  EXPECT(fork1s_simulation_step(s, 1, FORK1S_HOLD, NULL) == FORK1S_OK);
  EXPECT(fork1s_simulation_velocities(s, after, 6) == FORK1S_OK);
  EXPECT(fabs(after[5] - before[5] + 9.81 / 60) < 1e-6);

  REFUSED(fork1s_simulation_pull(NULL, 0, NULL, target, 1, 1), "simulation is NULL");
  REFUSED(fork1s_simulation_pull(s, 1, NULL, target, 1, 1), "body");
  REFUSED(fork1s_simulation_pull(s, 0, NULL, NULL, 1, 1), "target is NULL");
  REFUSED(fork1s_simulation_pull(s, 0, broken, target, 1, 1), "point must be finite, and entry 1 is nan");
  REFUSED(fork1s_simulation_pull(s, 0, NULL, target, -1, 1), "no finite stiffness above 0");
  REFUSED(fork1s_simulation_pull(s, 0, NULL, target, 1, NAN), "no finite damping");
  REFUSED(fork1s_simulation_release(s, 1), "body");
  fork1s_simulation_free(s);
}

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  test_models(argv[1]);
  test_controls_and_bodies(argv[1]);
  test_state(argv[1]);
  test_friction();
  test_rays();
  test_pulls();
  if (failures > 0) fprintf(stderr, "calls.c: %d failed\n", failures);
  return failures > 0 ? 1 : 0;
}
