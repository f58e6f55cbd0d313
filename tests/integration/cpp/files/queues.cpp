// Queues, spinners and the forms of callbacks of roscpp: one node that talks to itself.
#include <boost/thread.hpp>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_msgs/Int32.h>
#include <std_msgs/String.h>

#include <string>

namespace {

struct Listener {
    void pointer(const std_msgs::Int32ConstPtr& message) { ROS_INFO("pointer %d", message->data); }
    void reference(const boost::shared_ptr<std_msgs::Int32 const>& message) { ROS_INFO("reference %d", message->data); }
    void value(std_msgs::Int32 message) { ROS_INFO("value %d", message.data); }
    void fixed(const std_msgs::Int32::ConstPtr& message) const { ROS_INFO("fixed %d", message->data); }
    void event(const ros::MessageEvent<std_msgs::Int32 const>& event) {
        ROS_INFO("event %d %d", event.getConstMessage()->data, event.getReceiptTime() <= ros::Time::now());
    }
    void changed(const ros::MessageEvent<std_msgs::Int32>& event) {
        event.getMessage()->data = 0;
        ROS_INFO("changed %d", event.getConstMessage()->data);
    }
    void tick(const ros::TimerEvent&) { ROS_INFO("tick"); }
};

void on_own_queue(const std_msgs::Int32ConstPtr& message) { ROS_INFO("own queue %d", message->data); }
void function(const std_msgs::Int32ConstPtr& message) { ROS_INFO("function %d", message->data); }

ros::CallbackQueue queue;

void connected(const ros::SingleSubscriberPublisher& publisher) {
    std_msgs::String welcome;
    welcome.data = "welcome " + publisher.getSubscriberName() + " on " + publisher.getTopic();
    publisher.publish(welcome);
}
void disconnected(const ros::SingleSubscriberPublisher&) { ROS_INFO("disconnected"); }
void greeted(const std_msgs::StringConstPtr& message) { ROS_INFO("%s", message->data.c_str()); }

}  // namespace

int main(int argc, char** argv) {
    ros::Time::init();
    ros::Duration(0.5).sleep();
    ros::init(argc, argv, "queues");
    ros::NodeHandle node;
    Listener listener;
    boost::shared_ptr<Listener> lost(new Listener);

    ros::V_Subscriber subscribers;
    subscribers.push_back(node.subscribe<std_msgs::Int32>("numbers", 10, &Listener::pointer, &listener));
    subscribers.push_back(node.subscribe("numbers", 10, &Listener::reference, &listener));
    subscribers.push_back(node.subscribe("numbers", 10, &Listener::value, &listener));
    subscribers.push_back(node.subscribe<std_msgs::Int32>("numbers", 10, &Listener::fixed, &listener));
    subscribers.push_back(node.subscribe("numbers", 10, &Listener::event, &listener));
    subscribers.push_back(node.subscribe("numbers", 10, &Listener::changed, &listener));
    subscribers.push_back(node.subscribe<std_msgs::Int32>("numbers", 10, function));
    subscribers.push_back(node.subscribe("numbers", 10, &Listener::pointer, lost));
    lost.reset();
    auto options = ros::SubscribeOptions::create<std_msgs::Int32>("numbers", 10, on_own_queue, ros::VoidPtr(), &queue);
    subscribers.push_back(node.subscribe(options));

    auto greetings = node.advertise<std_msgs::String>("greetings", 10, connected, disconnected);
    auto greeter = node.subscribe("greetings", 10, greeted);
    auto numbers = node.advertise<std_msgs::Int32>("numbers", 10);

    std_msgs::Int32 number;
    number.data = 7;
    ros::AsyncSpinner spinner(2);
    spinner.start();
    ros::Duration(0.5).sleep();
    numbers.publish(number);
    ros::Duration(0.5).sleep();
    greeter.shutdown();
    ros::Duration(0.5).sleep();
    spinner.stop();
    numbers.publish(number);
    ros::Duration(0.5).sleep();
    ROS_INFO("nobody spins");
    queue.callAvailable(ros::WallDuration(1.0));
    ROS_INFO("empty %d", queue.isEmpty());

    boost::mutex mutex;
    boost::mutex::scoped_lock lock(mutex);
    boost::thread thread([&](int number) {
        boost::mutex::scoped_lock own(mutex);
        ROS_INFO("thread %d %d", number, boost::this_thread::get_id() == boost::thread::id());
    }, 5);
    ros::Duration(0.1).sleep();
    ROS_INFO("unlock");
    lock.unlock();
    thread.join();

    node.setParam("/level", 3);
    std::string found;
    ROS_INFO("search %d %s", node.searchParam("level", found), found.c_str());
    try {
        ROS_INFO("negative %f", (ros::Time(5.0) - ros::Duration(7.0)).toSec());
    } catch (const std::runtime_error& error) {
        ROS_INFO("out of range");
    }
    auto timer = node.createTimer(ros::Duration(1.0), &Listener::tick, &listener, true);
    ros::MultiThreadedSpinner(2).spin();
    return 0;
}
