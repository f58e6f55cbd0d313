// A component with a class: it provides one interface, requires another, and has a flow of control of its own.
#include <unistd.h>
#include <volery/interfaces.h>
#include <volery/services.h>

#include <chrono>
#include <stdexcept>

static int rounds = 0;  // of this instance alone

class Adder : public Adding {
public:
    explicit Adder(Listing& list) : list_(list) {}

    std::int64_t add(std::int64_t a, std::int64_t b) override {
        usleep(500000);
        return a + b + 100 * rounds;
    }
    std::vector<Position> shifted(const std::vector<Position>& points, double north) override {
        if (points.empty()) throw std::out_of_range("no points");
        auto moved = points;
        for (auto& point : moved) point.latitude += north;
        return moved;
    }
    void run() {
        auto const start = std::chrono::steady_clock::now();
        for (int left = volery::parameter<int>("rounds"); left > 0; --left) {
            ++rounds;
            volery::sleep(1.0);
            auto const names = list_.names(rounds);
            volery::log(names.at(0) + " of " + std::to_string(names.size()));
            uc_add_times(0.002);
        }
        std::chrono::duration<double> const took = std::chrono::steady_clock::now() - start;
        volery::note("adder", "run", "done", std::to_string(took.count()));
        try {
            list_.names(-1);
        } catch (const volery::Error& error) {
            volery::log(error.what(), "warning");
        }
    }

private:
    Listing& list_;
};
