// Localises by particles: move, weigh by ranges to landmarks, resample systematically.
#include <cmath>
#include <vector>

#include "kernel.hpp"

namespace {

struct Particle {
    double x, y, heading, weight;
};

std::vector<Particle> start;
std::vector<double> landmarks, ranges;
int rounds;

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    start.clear();
    landmarks.clear();
    ranges.clear();
    rounds = of(input, 6, 4, 5, 7);
    for (int i = 0; i < of(input, 250, 400, 300, 350); ++i)
        start.push_back({numbers.between(-5, 5), numbers.between(-5, 5), numbers.between(-M_PI, M_PI), 0.0});
    for (int i = 0; i < of(input, 4, 6, 8, 5); ++i) {
        landmarks.push_back(numbers.between(-10, 10));
        landmarks.push_back(numbers.between(-10, 10));
        ranges.push_back(numbers.between(2, 12));
    }
}

double kernel() {
    std::vector<Particle> particles = start, next(start.size());
    Numbers noise(CALIBRATING);
    double x = 0.0, y = 0.0;
    for (int round = 0; round < rounds; ++round) {
        double total = 0.0;
        for (Particle& particle : particles) {
            particle.heading += 0.05 + noise.between(-0.02, 0.02);
            double step = 0.3 + noise.between(-0.05, 0.05);
            particle.x += step * std::cos(particle.heading);
            particle.y += step * std::sin(particle.heading);
            double wrong = 0.0;
            for (std::size_t i = 0; i < ranges.size(); ++i) {
                double dx = landmarks[2 * i] - particle.x, dy = landmarks[2 * i + 1] - particle.y;
                double error = std::sqrt(dx * dx + dy * dy) - ranges[i];
                wrong += error * error;
            }
            particle.weight = std::exp(-0.5 * wrong / (4.0 * static_cast<double>(ranges.size())));
            total += particle.weight;
        }
        double each = total / static_cast<double>(particles.size()), mark = each * 0.5, sum = particles[0].weight;
        std::size_t chosen = 0;
        x = y = 0.0;
        for (Particle& copy : next) {
            while (sum < mark && chosen + 1 < particles.size())
                sum += particles[++chosen].weight;
            copy = particles[chosen];
            x += copy.x;
            y += copy.y;
            mark += each;
        }
        particles.swap(next);
    }
    return (x + y) / static_cast<double>(particles.size());
}
