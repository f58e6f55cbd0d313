// Ends in the way that its parameter says.
#include <ros/ros.h>

#include <cstdlib>
#include <iostream>
#include <stdexcept>

static volatile int zero = 0;

static int descend(int depth) {
    volatile char much[4096];
    much[0] = static_cast<char>(depth);
    return descend(depth + 1) + much[0];
}

int main(int argc, char** argv) {
    ros::init(argc, argv, "crash");
    ros::NodeHandle own("~");
    std::string how;
    own.getParam("how", how);
    ros::Duration(2.5).sleep();
    std::cout << "and now: " << how << std::endl;
    ros::Duration(1.0).sleep();
    if (how == "segmentation fault") *reinterpret_cast<volatile int*>(zero) = 1;  // line 24
    if (how == "throw") throw std::out_of_range("nothing there");
    if (how == "loop") for (;;) ++zero;  // line 26
    if (how == "recursion") return descend(0);
    if (how == "abort") std::abort();
    if (how == "status") return 3;
    ros::spin();
}
