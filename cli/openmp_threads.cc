#include "cli/openmp_threads.h"

#include <tbb/task_scheduler_observer.h>

#include <cstdlib>

#include "core/own_environment.h"

// Of OpenMP's runtime, which Open3D brings; its header is the compiler's, and not every compiler's.
extern "C" void omp_set_num_threads(int threads);

namespace tsdfpp {
namespace {

// OpenMP's number is a thread's own.
class LimitEachWorker : public tbb::task_scheduler_observer {
 public:
  LimitEachWorker() { observe(true); }
  ~LimitEachWorker() override { observe(false); }
  void on_scheduler_entry(bool /*is_worker*/) override { omp_set_num_threads(1); }
};

}  // namespace

void LimitOpenMpThreads() {
  if (std::getenv(kOpenMpThreads) != nullptr) return;
  // Open3D looks at the variable and then asks OpenMP, whose runtime has read it long ago.
  setenv(kOpenMpThreads, "1", 1);
  setenv(kOwnOpenMpThreads, "1", 1);
  omp_set_num_threads(1);
  static const LimitEachWorker limit_each_worker;
}

}  // namespace tsdfpp
