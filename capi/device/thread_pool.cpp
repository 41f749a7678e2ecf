// SPDX-License-Identifier: Apache-2.0
#include "device/thread_pool.h"

#include <cxxabi.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <list>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "device/cancellation.h"
#include "device/host_memory.h"
#include "device/interrupt.h"

namespace ks {
namespace {

unsigned usable_core_count() {
  // The mask grows until the kernel accepts it: machines may have more cores than a plain cpu_set_t holds.
  for (int capacity = 1024; capacity <= 1 << 17; capacity *= 2) {
    cpu_set_t* set = CPU_ALLOC(capacity);
    if (set == nullptr) break;
    const size_t bytes = CPU_ALLOC_SIZE(capacity);
    const bool known = sched_getaffinity(0, bytes, set) == 0;
    const int count = known ? CPU_COUNT_S(bytes, set) : 0;
    CPU_FREE(set);
    if (known) return static_cast<unsigned>(std::max(count, 1));
  }
  return std::max(std::thread::hardware_concurrency(), 1u);
}

thread_local bool in_task = false;
constexpr std::chrono::milliseconds between_looks(20);  // of a caller that waits for its workers

/// While a thread runs tasks, its own parallel_for shares nothing.
class InTask {
 public:
  InTask() : before_(std::exchange(in_task, true)) {}
  ~InTask() { in_task = before_; }
  InTask(const InTask&) = delete;
  InTask& operator=(const InTask&) = delete;

 private:
  bool before_;
};

// One parallel_for: lives on its caller's stack while it runs.
struct Job {
  const std::function<void(size_t)>& fn;
  const size_t count;
  Interrupt* const interrupt = Interrupt::current();
  std::atomic<size_t> next{0};
  HostMemory* const memory = HostMemory::current();
  unsigned helper_count = 0;  // workers inside run(); guarded by the pool's mutex
  std::mutex failure_mutex;
  size_t failure_index = SIZE_MAX;
  std::exception_ptr failure;

  // Indices are handed out in order, so the lowest failing one always runs: which exception is rethrown does not depend on the threads.
  // A forced unwind is caught as a reference to nothing, which the undefined-behaviour sanitizer would report.
  __attribute__((no_sanitize("undefined"))) void run() {
    const InTask inside;
    const Interrupt::Adopted adopted(interrupt);
    const HostMemory::Use used(memory);
    for (size_t i = next++; i < count; i = next++) {
      try {
        interruption_point();
        fn(i);
      } catch (abi::__forced_unwind&) {  // the calling thread ends: no one is left to hear of it
        next = count;
        throw;
      } catch (...) {
        std::lock_guard lock(failure_mutex);
        if (i < failure_index) {
          failure_index = i;
          failure = std::current_exception();
        }
        next = count;
      }
    }
  }
};

}  // namespace

struct ThreadPool::State {
  ks_parallel_for_fn hosts = nullptr;
  void* user = nullptr;
  unsigned size = 1;
  std::mutex mutex;
  std::condition_variable work, idle;
  std::list<Job*> jobs;
  std::vector<std::thread> threads;
  bool stopping = false;

  ~State() {
    {
      std::lock_guard lock(mutex);
      stopping = true;
    }
    work.notify_all();
    for (std::thread& thread : threads) thread.join();
  }

  Job* unfinished_job() {
    const auto found = std::find_if(jobs.begin(), jobs.end(), [](const Job* job) { return job->next < job->count; });
    return found == jobs.end() ? nullptr : *found;
  }

  void serve() {
    std::unique_lock lock(mutex);
    for (;;) {
      Job* job = nullptr;
      work.wait(lock, [&] { return stopping || (job = unfinished_job()) != nullptr; });
      if (stopping) return;
      ++job->helper_count;
      lock.unlock();
      job->run();
      lock.lock();
      if (--job->helper_count == 0) idle.notify_all();
    }
  }
};

ThreadPool::ThreadPool(unsigned worker_count) : ThreadPool(worker_count, nullptr, nullptr) {
  state_->threads.reserve(size() - 1);
  for (unsigned i = 1; i < size(); ++i) state_->threads.emplace_back([state = state_.get()] { state->serve(); });
}

ThreadPool::ThreadPool(unsigned worker_count, ks_parallel_for_fn parallel_for, void* user) : state_(std::make_unique<State>()) {
  state_->hosts = parallel_for;
  state_->user = user;
  state_->size = worker_count == 0 ? usable_core_count() : worker_count;
}

ThreadPool::~ThreadPool() = default;

unsigned ThreadPool::size() const { return state_->size; }

bool ThreadPool::is_hosts() const { return state_->hosts != nullptr; }

void ThreadPool::parallel_for(size_t count, const std::function<void(size_t)>& fn) {
  if (count == 0) return;
  Job job{fn, count};
  if (is_hosts()) {
    // Each task takes indices until none is left: the host may run fewer of them than it was given, or all in this thread.
    if (count > 1 && !in_task) {
      const NoUnwinding barrier;
      state_->hosts(
          state_->user, std::min<size_t>(count, size()), [](void* work, uint64_t) { static_cast<Job*>(work)->run(); }, &job);
    }
    job.run();
    if (job.failure) std::rethrow_exception(job.failure);
    return;
  }
  const bool share = count > 1 && !in_task && !state_->threads.empty();
  if (share) {
    std::lock_guard lock(state_->mutex);
    state_->jobs.push_back(&job);
  }
  if (share) state_->work.notify_all();
  const auto finish = [&](bool asks) {
    if (!share) return;
    std::unique_lock lock(state_->mutex);
    state_->jobs.remove(&job);
    while (!state_->idle.wait_for(lock, between_looks, [&] { return job.helper_count == 0; })) {
      if (!asks || job.interrupt == nullptr) continue;
      lock.unlock();
      job.interrupt->ask_now_and_then();
      lock.lock();
    }
  };
  try {
    job.run();
    finish(true);
  } catch (...) {  // the calling thread ends; workers use the job, which lives on its stack
    job.next = count;
    finish(false);
    throw;
  }
  if (job.failure) std::rethrow_exception(job.failure);
}

}  // namespace ks
