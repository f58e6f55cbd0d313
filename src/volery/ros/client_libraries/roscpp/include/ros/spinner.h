// ros::AsyncSpinner and its siblings. Their threads are tasks of the run, which change at calls of ROS only.
#pragma once
#include <cstdint>
#include <memory>

#include "ros/callback_queue.h"

namespace ros {

// Run the callbacks that are ready.
inline void spinOnce() { volery::request("ros.spin_once"); }
// Run callbacks as they become ready, until the node shuts down.
inline void spin() { volery::request("ros.spin"); }

class AsyncSpinner {
public:
    explicit AsyncSpinner(std::uint32_t threads, CallbackQueue* queue = nullptr)
        : threads_(threads == 0 ? CORES : threads), queue_(queue) {}
    AsyncSpinner(const AsyncSpinner&) = delete;
    AsyncSpinner& operator=(const AsyncSpinner&) = delete;
    ~AsyncSpinner() {
        if (spinning_ != IDLE) volery::try_request("ros.spinner_stop", volery::Writer().put(spinning_));
    }

    bool canStart() const { return spinning_ == IDLE; }
    void start() {
        if (spinning_ != IDLE) return;
        auto const queue = detail::number_of(queue_);
        spinning_ = volery::request("ros.spinner", volery::Writer().put(queue)).integer();
        std::int64_t const number = spinning_;
        auto const callable = volery::register_callable([number](volery::Reader, volery::Writer&) {
            volery::request("ros.spinner_spin", volery::Writer().put(number));
        });
        for (std::uint32_t thread = 0; thread < threads_; ++thread)
            volery::request("ros.spawn", volery::Writer().put(callable).put("spinner"));
    }
    void stop() {
        if (spinning_ != IDLE) volery::request("ros.spinner_stop", volery::Writer().put(spinning_));
        spinning_ = IDLE;
    }

private:
    static constexpr std::uint32_t CORES = 4;  // of a computer on board, whatever this machine has
    static constexpr std::int64_t IDLE = -1;
    std::uint32_t threads_;
    CallbackQueue* queue_;
    std::int64_t spinning_ = IDLE;
};

class Spinner {
public:
    virtual ~Spinner() = default;
    virtual void spin(CallbackQueue* queue = nullptr) = 0;
};

class SingleThreadedSpinner : public Spinner {
public:
    void spin(CallbackQueue* queue = nullptr) override {
        auto const number = volery::request("ros.spinner", volery::Writer().put(detail::number_of(queue))).integer();
        volery::request("ros.spinner_spin", volery::Writer().put(number));
    }
};

class MultiThreadedSpinner : public Spinner {
public:
    explicit MultiThreadedSpinner(std::uint32_t threads = 0) : threads_(threads) {}
    void spin(CallbackQueue* queue = nullptr) override {
        AsyncSpinner spinner(threads_, queue);
        spinner.start();
        volery::request("ros.wait_for_shutdown");
    }

private:
    std::uint32_t threads_;
};

inline void spin(Spinner& spinner) { spinner.spin(); }

}  // namespace ros
