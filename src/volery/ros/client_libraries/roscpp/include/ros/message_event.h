#pragma once
#include "ros/subscriber.h"
