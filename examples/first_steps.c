/* Loads a model, sets a control, steps it and prints where its bodies stand. */
#include <fork1s/fork1s.h>
#include <stdio.h>
#include <stdlib.h>

/* Ends the program where a call failed. */
static void check(fork1s_status status) {
  if (status == FORK1S_OK) return;
  fprintf(stderr, "%s\n", fork1s_last_error());
  exit(3);
}

int main(int argc, char** argv) {
  fork1s_model* model = NULL;
  check(fork1s_model_load(argc > 1 ? argv[1] : "scenes/fourbar_gripper.xml", NULL, &model));
  fork1s_simulation* simulation = NULL;
  check(fork1s_simulation_create(model, "{\"dt\": 0.01}", &simulation));
  fork1s_model_free(model); /* the simulation keeps what it needs of it */

  int32_t grip = 0, bodies = 0;
  check(fork1s_simulation_find_control(simulation, "left_grip", &grip));
  check(fork1s_simulation_set_control(simulation, grip, 0.4));
  fork1s_report report;
  check(fork1s_simulation_step(simulation, 50, FORK1S_HOLD, &report)); /* half a second */
  printf("%d steps, %d contact points in the last one\n", (int)report.steps, (int)report.contacts);

  check(fork1s_simulation_num_bodies(simulation, &bodies));
  double* poses = malloc(7 * (size_t)bodies * sizeof *poses); /* x y z, then the quaternion w x y z */
  if (!poses) return 1;
  check(fork1s_simulation_poses(simulation, poses, 7 * (size_t)bodies));
  for (int32_t i = 0; i < bodies; ++i) {
    const char* name = NULL;
    check(fork1s_simulation_body_name(simulation, i, &name));
    printf("%s stands at %.4f %.4f %.4f m\n", name, poses[7 * i], poses[7 * i + 1], poses[7 * i + 2]);
  }
  free(poses);
  fork1s_simulation_free(simulation);
  return 0;
}
