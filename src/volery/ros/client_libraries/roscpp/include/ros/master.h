#pragma once
#include "ros/init.h"
