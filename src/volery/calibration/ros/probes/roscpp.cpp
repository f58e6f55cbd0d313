// Probe of roscpp: CPU time of calls into the client library. Prints one JSON object a line:
//   {"what": .., "x": .., "cycles": .., "waited_ns": .., "process_ns": .., "caller_ns": ..}
// process_ns: CPU time of the whole process; caller_ns: of the calling thread; waited_ns: time on the wall.
// Usage: roscpp BLOCK_MS PERIOD_MS,PERIOD_MS,.. SLEEP_MS,SLEEP_MS,.. SUBSCRIBERS,SUBSCRIBERS,..
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_srvs/Trigger.h>

namespace {
using Message = std_msgs::Float64MultiArray;
using Action = std::function<void()>;

const int kConnectMs = 10000;
const int kGlanceMs = 50;  // a check costs some CPU time, so there are few
const int kSettleMs = 100;
const int kFew = 2, kMany = 8;  // subscribers of topics that are published just after another
const int kFollowing = 4;       // and how many topics, for a difference above the noise
const double kSpinBlocks = 2.5;  // messages are rarer than cycles
const int kFeedsMs[] = {50, 20};  // periods of the peers' topics
const int kFeedTopics = 5;        // and how many of each are published at once

long received = 0;

long ns(clockid_t clock) {
  timespec now;
  clock_gettime(clock, &now);
  return now.tv_sec * 1000000000L + now.tv_nsec;
}

// Waits without ROS.
void pause(int ms) {
  timespec wanted = {ms / 1000, (ms % 1000) * 1000000L};
  nanosleep(&wanted, nullptr);
}

// Readings of the clocks between construction and report().
class Measured {
 public:
  Measured()
      : wall_(ns(CLOCK_MONOTONIC)), process_(ns(CLOCK_PROCESS_CPUTIME_ID)), caller_(ns(CLOCK_THREAD_CPUTIME_ID)) {}

  void report(const char* what, double x, long cycles) const {
    const long caller = ns(CLOCK_THREAD_CPUTIME_ID) - caller_;
    const long process = ns(CLOCK_PROCESS_CPUTIME_ID) - process_;
    const long wall = ns(CLOCK_MONOTONIC) - wall_;
    std::printf(
        "{\"what\": \"%s\", \"x\": %g, \"cycles\": %ld, \"waited_ns\": %ld, \"process_ns\": %ld, \"caller_ns\": %ld}\n",
        what, x, cycles, wall, process, caller);
    std::fflush(stdout);
  }

 private:
  long wall_, process_, caller_;
};

void until(const std::function<bool()>& done) {
  for (int waited = 0; !done() && waited < kConnectMs; waited += kGlanceMs) pause(kGlanceMs);
}

// Measures one call and the work of the library shortly after it.
void once(const char* what, const Action& call, const std::function<bool()>& done = [] { return true; }, double x = 0) {
  Measured measured;
  call();
  until(done);
  pause(kSettleMs);
  measured.report(what, x, 1);
}

// Measures as many cycles of a call and a sleep as fit into a block.
void block(const char* what, double x, double period_ms, double block_ms, const Action& call) {
  const long cycles = std::max(3L, static_cast<long>(block_ms / period_ms));
  const ros::Duration period(period_ms / 1000.0);
  for (int warm = 0; warm < 2; ++warm) {
    call();
    period.sleep();
  }
  Measured measured;
  for (long cycle = 0; cycle < cycles; ++cycle) {
    call();
    period.sleep();
  }
  measured.report(what, x, cycles);
}

std::vector<double> numbers(const char* text) {
  std::vector<double> found;
  std::stringstream stream(text);
  for (std::string one; std::getline(stream, one, ',');) found.push_back(std::atof(one.c_str()));
  return found;
}

void onMessage(const Message::ConstPtr&) { ++received; }

bool onRequest(std_srvs::Trigger::Request&, std_srvs::Trigger::Response&) {
  ++received;
  return true;
}

void registrations(ros::NodeHandle& node) {
  ros::Publisher publisher;
  ros::Subscriber subscriber, connected;
  ros::ServiceClient client;
  ros::ServiceServer server;
  once("advertise", [&] { publisher = node.advertise<Message>("calibration/unused", 10); });
  once("subscribe", [&] { subscriber = node.subscribe("calibration/silent", 10, onMessage); });
  once("connect", [&] { connected = node.subscribe("calibration/quiet", 10, onMessage); },
       [&] { return connected.getNumPublishers() > 0; });
  once("service_client", [&] { client = node.serviceClient<std_srvs::Trigger>("calibration/absent"); });
  once("advertise_service", [&] { server = node.advertiseService("calibration/service", onRequest); });
  once("settle", [] {});
  Measured measured;
  ros::spinOnce();
  measured.report("spin_once_first", 0, 1);
}

void publishing(ros::NodeHandle& node, const std::vector<double>& periods_ms, double block_ms,
                const std::vector<double>& counts) {
  Message message;
  message.data.resize(4);
  for (double count : counts) {
    ros::Publisher publisher;
    once("accept", [&] { publisher = node.advertise<Message>("calibration/to_" + std::to_string(int(count)), 10); },
         [&] { return publisher.getNumSubscribers() >= count; }, count);
    for (double period_ms : periods_ms) {
      block("idle", 0, period_ms, block_ms, [] {});
      block("publish", count, period_ms, block_ms, [&] { publisher.publish(message); });
    }
    publisher.shutdown();
    pause(kSettleMs);
  }
}

// Measures cycles that publish once, on several topics, and then spin: later calls find warm threads.
void spinning(ros::NodeHandle& node, const std::vector<double>& periods_ms, double block_ms) {
  Message message;
  message.data.resize(4);
  ros::Publisher first = node.advertise<Message>("calibration/to_1", 10);
  for (int count : {kFew, kMany}) {
    std::vector<ros::Publisher> others;
    for (int number = 0; number < kFollowing; ++number)
      others.push_back(node.advertise<Message>(
          "calibration/next_" + std::to_string(number) + "_" + std::to_string(count), 10));
    until([&] {
      return first.getNumSubscribers() > 0 && std::all_of(others.begin(), others.end(), [&](const ros::Publisher& one) {
               return one.getNumSubscribers() >= uint32_t(count);
             });
    });
    pause(kSettleMs);
    const auto both = [&] {
      first.publish(message);
      for (ros::Publisher& other : others) other.publish(message);
    };
    for (double period_ms : periods_ms) {
      block("publish_alone", 0, period_ms, block_ms, [&] { first.publish(message); });
      block("publish_both", count, period_ms, block_ms, both);
    }
    if (count == kFew) {
      block("spin_once", 0, periods_ms[0], block_ms, [&] {
        both();
        ros::spinOnce();
      });
    }
    for (ros::Publisher& other : others) other.shutdown();
    pause(kSettleMs);
  }
}

// Measures cycles that call a service, with a connection of its own as is usual, and idle cycles.
void calling(ros::NodeHandle& node, double period_ms, double block_ms) {
  ros::ServiceClient client = node.serviceClient<std_srvs::Trigger>("calibration/served");
  client.waitForExistence(ros::Duration(kConnectMs / 1000.0));
  std_srvs::Trigger trigger;
  client.call(trigger);
  block("idle_before_call", 0, period_ms, block_ms, [] {});
  block("call_service", 0, period_ms, block_ms, [&] { client.call(trigger); });
}

// Waits as ros::spin() does.
void spin_for(double ms) {
  const long end = ns(CLOCK_MONOTONIC) + static_cast<long>(ms * 1e6);
  while (ns(CLOCK_MONOTONIC) < end) ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
}

// Measures waiting with messages or requests, from the first one on.
void receive(const char* what, double x, double blocks, double block_ms) {
  const long none = received;
  until([none] {
    ros::spinOnce();
    return received > none;
  });
  spin_for(kSettleMs);
  const long before = received;
  Measured measured;
  spin_for(blocks * block_ms);
  measured.report(what, x, std::max(1L, received - before));
}

// Measures waiting without messages, with those of one topic, and of several published at once.
void receiving(ros::NodeHandle& node, double block_ms) {
  pause(kSettleMs);
  Measured waiting;
  spin_for(kSpinBlocks * block_ms);
  waiting.report("wait", 0, 1);
  for (int period_ms : kFeedsMs) {
    const double blocks = kSpinBlocks * period_ms / kFeedsMs[0];
    const std::string name = "calibration/feed_" + std::to_string(period_ms) + "_";
    std::vector<ros::Subscriber> feeds;
    const auto add = [&] {
      feeds.push_back(node.subscribe(name + std::to_string(feeds.size()), 10, onMessage));
      until([&] { return feeds.back().getNumPublishers() > 0; });
    };
    add();
    receive("receive", 1, blocks, block_ms);
    while (feeds.size() < kFeedTopics) add();
    receive("receive_burst", kFeedTopics, blocks, block_ms);
  }
}

void serving(ros::NodeHandle& node, double block_ms) {
  ros::ServiceServer server = node.advertiseService("calibration/answer", onRequest);
  receive("serve", 1, kSpinBlocks, block_ms);
}
}  // namespace

int main(int argc, char** argv) {
  if (argc < 5) return 2;
  const double block_ms = std::atof(argv[1]);
  const std::vector<double> periods_ms = numbers(argv[2]);
  once("nothing", [] {});
  once("init", [&] { ros::init(argc, argv, "calibration_probe"); });
  std::unique_ptr<ros::NodeHandle> node;
  once("node_handle", [&] {
    node.reset(new ros::NodeHandle);
    pause(3 * kSettleMs);
  });
  once("settle", [] { pause(5 * kSettleMs); });
  registrations(*node);
  for (double ms : numbers(argv[3])) block("sleep", ms * 1000.0, ms, block_ms, [] {});
  publishing(*node, periods_ms, block_ms, numbers(argv[4]));
  spinning(*node, periods_ms, block_ms);
  calling(*node, periods_ms[0], block_ms);
  receiving(*node, block_ms);
  receiving(*node, block_ms);
  serving(*node, block_ms);
  serving(*node, block_ms);
  return 0;
}
