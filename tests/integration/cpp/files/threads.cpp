// Threads, mutexes, condition variables and futures of the C++ library.
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <future>
#include <mutex>
#include <stdexcept>
#include <thread>

using namespace std::chrono_literals;

std::mutex lock;
std::condition_variable changed;
bool ready = false;

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }
void say(const char* what, int result) {
    std::printf("%s %d at %.1f\n", what, result, now());
}

int main() {
    std::thread holding([] {
        std::lock_guard<std::mutex> const guard(lock);
        std::this_thread::sleep_for(500ms);
        say("held", 1);
    });
    std::this_thread::sleep_for(100ms);
    lock.lock();
    say("locked", !lock.try_lock());
    lock.unlock();
    holding.join();

    std::thread waiting([] {
        std::unique_lock<std::mutex> guard(lock);
        changed.wait(guard, [] { return ready; });
        say("notified", ready);
    });
    std::this_thread::sleep_for(200ms);
    {
        std::lock_guard<std::mutex> const guard(lock);
        ready = true;
    }
    changed.notify_one();
    waiting.join();
    {
        std::unique_lock<std::mutex> guard(lock);
        auto const in_time = changed.wait_for(guard, 300ms, [] { return false; });
        say("in time", in_time);
    }

    std::promise<int> promise;
    auto future = promise.get_future();
    std::thread giving([&] {
        std::this_thread::sleep_for(100ms);
        promise.set_value(7);
    });
    say("late", future.wait_for(10ms) == std::future_status::timeout);
    auto const value = future.get();
    say("value", value);
    giving.join();
    auto other = std::async(std::launch::async, [] {
        std::this_thread::sleep_for(1s);
        return 5;
    });
    auto const later = other.get();
    say("later", later);

    std::recursive_mutex again;
    again.lock();
    say("again", again.try_lock());
    std::timed_mutex timed;
    timed.lock();
    std::thread trying([&] { say("in vain", !timed.try_lock_for(100ms)); });
    trying.join();
    std::thread::id inside;
    std::thread naming([&] { inside = std::this_thread::get_id(); });
    auto const outside = naming.get_id();
    naming.join();
    say("same thread", inside == outside);
    say("hash", static_cast<int>(std::hash<std::thread::id>()(std::this_thread::get_id()) % 1000));
    std::thread failing([] { throw std::runtime_error("on purpose"); });
    failing.join();
    return 0;
}
