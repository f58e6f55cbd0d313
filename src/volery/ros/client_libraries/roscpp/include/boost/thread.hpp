// boost::thread and mutexes on tasks of the run, which change at calls of ROS only.
#pragma once
#include <functional>
#include <memory>
#include <mutex>
#include <ostream>
#include <utility>

#include "ros/event.h"

namespace boost {

class thread {
public:
    class id {
    public:
        id() = default;
        explicit id(const void* task) : task_(task) {}
        bool operator==(const id& other) const { return task_ == other.task_; }
        bool operator!=(const id& other) const { return task_ != other.task_; }
        bool operator<(const id& other) const { return std::less<const void*>()(task_, other.task_); }
        friend std::ostream& operator<<(std::ostream& out, const id& one) { return out << one.task_; }

    private:
        const void* task_ = nullptr;
    };

    thread() = default;
    template <class Function, class... Arguments>
    explicit thread(Function function, Arguments... arguments) : run_(std::make_shared<Run>()) {
        auto const call = std::bind(std::move(function), std::move(arguments)...);
        auto const callable = volery::register_callable([call, run = run_](volery::Reader, volery::Writer&) mutable {
            run->task = id(volery_current_fiber());
            call();
            run->ended = true;
            run->event.notify();
        });
        volery::request("ros.spawn", volery::Writer().put(callable).put("boost::thread"));
    }
    thread(const thread&) = delete;
    thread& operator=(const thread&) = delete;
    thread(thread&& other) noexcept = default;
    thread& operator=(thread&& other) noexcept = default;

    bool joinable() const { return run_ != nullptr; }
    void join() {
        auto const run = std::exchange(run_, nullptr);
        if (run) run->event.wait([&] { return run->ended; }, ros::Duration(0.0), false);
    }
    void detach() { run_.reset(); }
    id get_id() const { return run_ ? run_->task : id(); }

private:
    struct Run {
        ros::detail::Event event;
        id task;
        bool ended = false;
    };
    std::shared_ptr<Run> run_;
};

namespace this_thread {

inline thread::id get_id() { return thread::id(volery_current_fiber()); }
inline void yield() { ros::Duration(0.0).sleep(); }
// Of a duration of boost::posix_time.
template <class Span>
void sleep(const Span& span) {
    ros::Duration().fromNSec(static_cast<std::int64_t>(span.total_microseconds()) * 1000).sleep();
}

}  // namespace this_thread

class mutex {
public:
    using scoped_lock = std::unique_lock<mutex>;
    mutex() = default;
    mutex(const mutex&) = delete;
    mutex& operator=(const mutex&) = delete;

    void lock() {
        while (!try_lock()) {
            ++waiting_;
            event_.wait([this] { return !locked_; }, ros::Duration(0.0), false);
            --waiting_;
        }
    }
    bool try_lock() { return !std::exchange(locked_, true); }
    void unlock() {
        locked_ = false;
        if (waiting_ > 0) event_.notify();
    }

private:
    ros::detail::Event event_;
    bool locked_ = false;
    int waiting_ = 0;
};

class recursive_mutex {
public:
    using scoped_lock = std::unique_lock<recursive_mutex>;

    void lock() {
        if (depth_ == 0 || owner_ != this_thread::get_id()) mutex_.lock();
        own();
    }
    bool try_lock() {
        if ((depth_ == 0 || owner_ != this_thread::get_id()) && !mutex_.try_lock()) return false;
        own();
        return true;
    }
    void unlock() {
        if (--depth_ == 0) mutex_.unlock();
    }

private:
    void own() {
        owner_ = this_thread::get_id();
        ++depth_;
    }
    mutex mutex_;
    thread::id owner_;
    int depth_ = 0;
};

template <class Mutex>
using unique_lock = std::unique_lock<Mutex>;
template <class Mutex>
using lock_guard = std::lock_guard<Mutex>;

}  // namespace boost
