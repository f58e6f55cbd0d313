#pragma once
#include "ros/publisher.h"
