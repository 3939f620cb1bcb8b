// What every benchmark is to the program that holds them all: a name, and what it does with the words behind
// it.
#pragma once

namespace fork1s::benchmarks::accuracy {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::contact_convergence {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::contact_problems {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::contact_recorded {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::detail_levels {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::detector_accuracy {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::error_families {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::legged {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::legged_rules {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::live_rate {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::long_and_many {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::long_chain {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::peer_table {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::recovery_cost {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::refresh_cost {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::scene_table {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::soak {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::step_cost {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::step_instructions {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::step_orders {
int Main(int argc, char** argv);
}
namespace fork1s::benchmarks::validation {
int Main(int argc, char** argv);
}
